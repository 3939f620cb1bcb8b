#include <fork1s/linalg/products.hpp>

namespace fork1s {

MatrixX Times(const MatrixView& A, const MatrixView& B) { return A * B; }
MatrixX TransposedTimes(const MatrixView& A, const MatrixView& B) { return A.transpose() * B; }
MatrixX TimesTransposed(const MatrixView& A, const MatrixView& B) { return A * B.transpose(); }
MatrixX ScaledRows(const VectorView& d, const MatrixView& A) { return d.asDiagonal() * A; }
MatrixX ScaledColumns(const MatrixView& A, const VectorView& d) { return A * d.asDiagonal(); }
MatrixX Congruence(const MatrixView& M, const MatrixView& A) { return Times(TransposedTimes(A, M), A); }
MatrixX DifferenceOfSquares(const MatrixView& A, const MatrixView& B) {
  const Eigen::Index n = A.rows();
  MatrixX out(n, n);
  VectorX row;
  for (Eigen::Index j = 0; j < n; ++j) {
    auto rest = out.col(j).tail(n - j);
    row = A.row(j);
    rest.noalias() = A.bottomRows(n - j) * row;
    row = B.row(j);
    rest.noalias() -= B.bottomRows(n - j) * row;
    out.row(j).tail(n - j) = rest.transpose();
  }
  return out;
}
MatrixX DiagonalCongruence(const VectorView& d, const MatrixView& A) {
  return TransposedTimes(A, ScaledRows(d, A));
}

}  // namespace fork1s
