// Which rule of the step a simulation takes.
#pragma once

#include <fork1s/dynamics/world.hpp>

namespace fork1s::internal {

/// By twists everything keeps the inertia of the reference, and a step is one of implicit Euler.
inline Integrator IntegratorFor(Integrator wanted, Recovery recovery, const World& world) {
  if (recovery == Recovery::kTwist) return Integrator::kEuler;
  if (wanted != Integrator::kAuto) return wanted;
  return world.PairsThatMayTouch().empty() ? Integrator::kTheta : Integrator::kEuler;
}

}  // namespace fork1s::internal
