#include "linalg/row_squares.hpp"

#include <algorithm>
#include <fork1s/base/error.hpp>
#include <fork1s/base/quad.hpp>

namespace fork1s {

namespace {

// Of 4 kQuads rows from `row` on and four columns from `column` on, the sum over all rows of Q in registers. Entries
// above `first_row`, left of `first_column` or above the diagonal belong to other tiles or are not asked for.
template <int kQuads>
void AddTile(const RowMatrixX& Q, const WeightedRows& of, double factor, int row, int first_row, int column,
             int first_column, Eigen::Ref<MatrixX> A) {
  Quad sum[4][kQuads];
  for (auto& quads : sum)
    for (Quad& s : quads) s.setZero();
  const double* const base = Q.data() + of.begin;
  for (std::size_t i = 0; i < of.rows.size(); ++i) {
    const double* q = base + of.rows[i] * Q.cols();
    Quad weighted[kQuads];
    for (int k = 0; k < kQuads; ++k) weighted[k] = of.weights[i] * QuadAt(q + row + 4 * k);
    for (int c = 0; c < 4; ++c)
      for (int k = 0; k < kQuads; ++k) sum[c][k] += q[column + c] * weighted[k];
  }
  for (int c = first_column - column; c < 4; ++c) {
    double* to = &A(of.begin + row, of.begin + column + c);
    for (int r = std::max(first_row, column + c) - row; r < 4 * kQuads; ++r)
      to[r] += factor * sum[c][r / 4][r % 4];
  }
}

// All of fewer than four columns.
template <int kSize>
void AddSmall(const RowMatrixX& Q, const WeightedRows& of, double factor, Eigen::Ref<MatrixX> A) {
  double sum[kSize][kSize] = {};
  for (std::size_t i = 0; i < of.rows.size(); ++i) {
    const double* q = Q.data() + of.rows[i] * Q.cols() + of.begin;
    for (int k = 0; k < kSize; ++k)
      for (int l = k; l < kSize; ++l) sum[k][l] += of.weights[i] * q[k] * q[l];
  }
  for (int k = 0; k < kSize; ++k)
    for (int l = k; l < kSize; ++l) A(of.begin + l, of.begin + k) += factor * sum[k][l];
}

}  // namespace

// Tiles of twelve rows, eight or four by four columns. The last begin where they end with the matrix.
void AddRowSquares(const RowMatrixX& Q, const WeightedRows& of, double factor, Eigen::Ref<MatrixX> A) {
  FORK1S_REQUIRE(of.begin >= 0 && of.begin + of.size <= Q.cols() && A.rows() == Q.cols(), of.begin, of.size);
  if (of.size == 1) return AddSmall<1>(Q, of, factor, A);
  if (of.size == 2) return AddSmall<2>(Q, of, factor, A);
  if (of.size == 3) return AddSmall<3>(Q, of, factor, A);
  for (int k = 0; k < of.size; k += 4) {
    const int column = std::min(k, of.size - 4);
    for (int l = k; l < of.size;) {
      const int quads = std::min({3, (of.size - l + 3) / 4, of.size / 4});
      const int row = std::min(l, of.size - 4 * quads);
      const auto add = quads == 3 ? &AddTile<3> : quads == 2 ? &AddTile<2> : &AddTile<1>;
      add(Q, of, factor, row, l, column, k, A);
      l += 4 * quads;
    }
  }
}

}  // namespace fork1s
