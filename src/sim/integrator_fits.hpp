// Which recovery a rule of the step can use.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/dynamics/world.hpp>

namespace fork1s::internal {

/// kUsage where the step of second order is asked of the recovery that keeps the inertia of the reference.
inline Expected<void> IntegratorFits(Integrator integrator, Recovery recovery) {
  if (integrator == Integrator::kTheta && recovery == Recovery::kTwist)
    return Fail(ErrorCode::kUsage, "integrator 'theta'",
                "needs recovery 'exact' or 'curved': 'twist' keeps the inertia of the reference");
  return {};
}

}  // namespace fork1s::internal
