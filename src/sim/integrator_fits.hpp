// Which rule of the step a simulation takes.
#pragma once

#include <fork1s/dynamics/world.hpp>

namespace fork1s::internal {

/// By twists everything keeps the inertia of the reference, and a step is one of implicit Euler.
inline Integrator IntegratorBy(Recovery recovery, Integrator chosen) {
  return recovery == Recovery::kTwist ? Integrator::kEuler : chosen;
}

}  // namespace fork1s::internal
