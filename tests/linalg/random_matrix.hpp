// The same numbers with every standard library.
#pragma once

#include <fork1s/base/types.hpp>
#include <random>

namespace fork1s::testing {

/// Uniform in [-1, 1].
inline MatrixX RandomMatrix(Eigen::Index rows, Eigen::Index cols, std::mt19937& engine) {
  MatrixX m(rows, cols);
  for (Eigen::Index j = 0; j < cols; ++j)
    for (Eigen::Index i = 0; i < rows; ++i) m(i, j) = 2.0 * static_cast<double>(engine()) / 4294967295.0 - 1;
  return m;
}

}  // namespace fork1s::testing
