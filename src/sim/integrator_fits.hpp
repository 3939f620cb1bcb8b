// Which rule of the step a simulation takes.
#pragma once

#include <fork1s/dynamics/world.hpp>

namespace fork1s::internal {

/// What a scene's bodies, seen as its files name them, make of kAuto.
inline Integrator IntegratorFor(Integrator wanted, const World& world) {
  if (wanted != Integrator::kAuto) return wanted;
  return world.PairsThatMayTouch().empty() ? Integrator::kTheta : Integrator::kEuler;
}

/// By twists everything keeps the inertia of the reference, and a step is one of implicit Euler.
inline Integrator IntegratorBy(Recovery recovery, Integrator chosen) {
  return recovery == Recovery::kTwist ? Integrator::kEuler : chosen;
}

}  // namespace fork1s::internal
