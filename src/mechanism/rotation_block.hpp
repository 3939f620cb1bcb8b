// Armature and damping of rotations in matrices of all joint coordinates.
#pragma once

#include <fork1s/mechanism/kinematics.hpp>

namespace fork1s::internal {

/// A += Eᵀ diag(weights) E - diag(weights) in the rows and columns of θ: what the diagonal alone would have is
/// replaced.
inline void AddRotationBlock(const Mechanism& mechanism, const Kinematics& kinematics,
                             const Mechanism::Rotation& rotation, const VectorX& weights, MatrixX& A) {
  const auto& at = rotation.coordinates;
  if (weights(at[0]) == 0 && weights(at[1]) == 0 && weights(at[2]) == 0) return;
  const Matrix3 block = WeightedRotationBlock(mechanism, kinematics, rotation, weights);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const int row = at[static_cast<std::size_t>(i)], column = at[static_cast<std::size_t>(j)];
      A(row, column) += block(i, j) - (i == j ? weights(row) : 0);
    }
}

}  // namespace fork1s::internal
