// Rotation of stacked six-vectors from the root frame to world axes.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>

namespace fork1s::internal {

inline MatrixX WorldAxes(const Mechanism& mechanism, std::size_t count) {
  MatrixX R = MatrixX::Zero(6 * static_cast<Eigen::Index>(count), 6 * static_cast<Eigen::Index>(count));
  for (Eigen::Index i = 0; i < 2 * static_cast<Eigen::Index>(count); ++i)
    R.block<3, 3>(3 * i, 3 * i) = mechanism.definition().X_WR.rotation();
  return R;
}

}  // namespace fork1s::internal
