// Inertia of a mechanism along given motions of its joints, at one pose.
#pragma once

#include <fork1s/mechanism/kinematics.hpp>
#include <vector>

namespace fork1s::internal {

struct InertiaAlong {
  MatrixX M;              // r x r: Qᵀ M Q, armature included
  Matrix6X M_0z;          // 6 x r: what the whole has of momentum about R's origin
  Matrix6 M_00;           // of the whole
  std::vector<double> T;  // joint by joint 6 rows of r: twist of what it carries

  const double* T_of(int joint) const { return T.data() + 6 * M_0z.cols() * joint; }
};

/// Q: n x r. In time linear in coordinates times the square of the columns that move each, from its first to
/// its last.
InertiaAlong ComputeInertiaAlong(const Mechanism& mechanism, const Kinematics& kinematics,
                                 const RowMatrixX& Q);

}  // namespace fork1s::internal
