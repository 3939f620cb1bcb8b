// Sums of squares of rows, what dampers of joints are in reduced coordinates.
#pragma once

#include <fork1s/base/types.hpp>
#include <vector>

namespace fork1s {

/// Rows of a matrix that are 0 outside the same columns, each with its weight.
struct WeightedRows {
  int begin = 0, size = 0;  // columns
  std::vector<int> rows;
  std::vector<double> weights;
};

/// A += factor Σ w_i q_i q_iᵀ over rows q_i of Q [n x r], in the lower triangle of A [r x r]. No allocation.
void AddRowSquares(const RowMatrixX& Q, const WeightedRows& of, double factor, Eigen::Ref<MatrixX> A);

}  // namespace fork1s
