// What loops bear: the multipliers of the rigid closures.
#pragma once

#include "stepping/step_context.hpp"

namespace fork1s {

/// Forces of the rigid closures and couplings [num_constraints], in the order and axes of ClosureResidual:
/// what the joined parts bear so that the residual stays 0, positive where springs and loads would open it.
/// From the balance of joint forces after a step of h [s], by the metric of the loop correction where the
/// interior is not in balance. What rows bear against each other where the joints can hardly yield stays
/// that of `near` [num_constraints]. `contacts_R` [6 x bodies]: wrenches of the step's contacts in R.
/// Allocates.
VectorX ClosureForces(const ConstStepContext& here, double h, const Matrix6X& contacts_R,
                      const VectorX& near);

}  // namespace fork1s
