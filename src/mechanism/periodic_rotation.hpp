// Ball joints that may turn for ever.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>

namespace fork1s {

/// Whether a joint is a ball whose rotation vector θ nothing acts on: no spring, servo, stop or coupling
/// tells θ from θ (1 - 2π/|θ|), the same pose.
bool IsPeriodic(const Mechanism& mechanism, const Mechanism::Joint& joint);

}  // namespace fork1s
