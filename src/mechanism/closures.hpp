// Errors of one closure and their derivatives, shared by the rigid rows and the springy ones.
#pragma once

#include <fork1s/mechanism/kinematics.hpp>

namespace fork1s::internal {

/// c = [log R_E; p_E] with E = X_aJ⁻¹ X_bJ.
Vector6 ClosureError(const ClosureDef& closure, const Kinematics& kinematics, RigidTransform* X_aJ = nullptr,
                     RigidTransform* E = nullptr);

/// c and its derivative (6 x n) by every coordinate.
void ClosureErrorJacobian(const Mechanism& mechanism, const ClosureDef& closure, const Kinematics& kinematics,
                          Vector6& c, Eigen::Ref<Matrix6X> rows);

}  // namespace fork1s::internal
