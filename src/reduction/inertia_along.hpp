// Inertia of a mechanism along given motions of its joints, at one pose.
#pragma once

#include <fork1s/mechanism/kinematics.hpp>

namespace fork1s::internal {

struct InertiaAlong {
  MatrixX M;      // r x r: Qᵀ M Q, armature included
  Matrix6X M_0z;  // 6 x r: momentum of the whole about R's origin
  Matrix6 M_00;   // of the whole
  MatrixX T;      // 6 r x joints: twist of what a joint carries, row by row of the 6 x r

  auto T_of(int joint) const {
    return Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::RowMajor>>(T.col(joint).data(), 6,
                                                                                       M_0z.cols());
  }
};

/// Q: n x r. In time linear in coordinates times the square of the columns that move each, from its first to
/// its last.
InertiaAlong ComputeInertiaAlong(const Mechanism& mechanism, const Kinematics& kinematics,
                                 const RowMatrixX& Q);

}  // namespace fork1s::internal
