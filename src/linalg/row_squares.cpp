#include <fork1s/linalg/row_squares.hpp>

#include <algorithm>
#include <fork1s/base/error.hpp>
#include <fork1s/base/quad.hpp>

namespace fork1s {

// Four columns by four at a time, the sum over all rows in registers. The last four begin where they end with
// the others, and what of them stands in the four before is not taken twice.
void AddRowSquares(const RowMatrixX& Q, const WeightedRows& of, double factor, Eigen::Ref<MatrixX> A) {
  FORK1S_REQUIRE(of.begin >= 0 && of.begin + of.size <= Q.cols() && A.rows() == Q.cols(), of.begin, of.size);
  const auto count = of.rows.size();
  if (of.size < 4) {
    for (std::size_t i = 0; i < count; ++i) {
      const double *q = Q.data() + of.rows[i] * Q.cols() + of.begin, weight = factor * of.weights[i];
      for (int k = 0; k < of.size; ++k)
        for (int l = k; l < of.size; ++l) A(of.begin + l, of.begin + k) += weight * q[k] * q[l];
    }
    return;
  }
  for (int k = 0; k < of.size; k += 4) {
    const int column = std::min(k, of.size - 4);
    for (int l = k; l < of.size; l += 4) {
      const int row = std::min(l, of.size - 4);
      Quad sum[4];
      for (Quad& s : sum) s.setZero();
      for (std::size_t i = 0; i < count; ++i) {
        const double* q = Q.data() + of.rows[i] * Q.cols() + of.begin;
        const Quad weighted = of.weights[i] * QuadAt(q + row);
        for (int c = 0; c < 4; ++c) sum[c] += q[column + c] * weighted;
      }
      for (int c = k - column; c < 4; ++c)
        for (int r = std::max(l - row, column + c - row); r < 4; ++r)
          A(of.begin + row + r, of.begin + column + c) += factor * sum[c](r);
    }
  }
}

}  // namespace fork1s
