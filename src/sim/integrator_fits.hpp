// Which rule of the step a simulation takes.
#pragma once

#include <algorithm>
#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/dynamics/theta_scheme.hpp>
#include <fork1s/dynamics/world.hpp>

namespace fork1s::internal {

/// What steps of `h` [s] make of kAuto: the rule of second order where one of the mechanisms, seen as their files
/// name their interfaces, has a motion that such a step can follow. Elsewhere it is as exact as implicit Euler, which
/// costs less. What falls free follows its parabola by either.
inline Integrator IntegratorFor(Integrator wanted, const World& world, double h) {
  if (wanted != Integrator::kAuto) return wanted;
  const auto& mechanisms = world.mechanisms();
  return std::any_of(mechanisms.begin(), mechanisms.end(),
                     [h](const MechanismDynamics& m) { return FollowsAnyMode(m.model(), h); })
             ? Integrator::kTwoStage
             : Integrator::kEuler;
}

/// By twists everything keeps the inertia of the reference, and a step is one of implicit Euler.
inline Integrator IntegratorBy(Recovery recovery, Integrator chosen) {
  return recovery == Recovery::kTwist ? Integrator::kEuler : chosen;
}

}  // namespace fork1s::internal
