#include "linalg/products.hpp"

namespace fork1s {

MatrixX Times(const MatrixView& A, const MatrixView& B) { return A * B; }
MatrixX TransposedTimes(const MatrixView& A, const MatrixView& B) { return A.transpose() * B; }
MatrixX TimesTransposed(const MatrixView& A, const MatrixView& B) { return A * B.transpose(); }
MatrixX ScaledRows(const VectorView& d, const MatrixView& A) { return d.asDiagonal() * A; }
MatrixX ScaledColumns(const MatrixView& A, const VectorView& d) { return A * d.asDiagonal(); }
MatrixX Congruence(const MatrixView& M, const MatrixView& A) { return Times(TransposedTimes(A, M), A); }
MatrixX DifferenceOfSquares(const MatrixView& A, const MatrixView& B) {
  const Eigen::Index n = A.rows(), half = n / 2;
  MatrixX left(n, A.cols() + B.cols()), right(n, left.cols());
  left << A, B;
  right << A, -B;
  MatrixX out(n, n);
  out.leftCols(half) = TimesTransposed(left, right.topRows(half));
  out.bottomRightCorner(n - half, n - half) =
      TimesTransposed(left.bottomRows(n - half), right.bottomRows(n - half));
  out.topRightCorner(half, n - half) = out.bottomLeftCorner(n - half, half).transpose();
  return out;
}
MatrixX DiagonalCongruence(const VectorView& d, const MatrixView& A) {
  return TransposedTimes(A, ScaledRows(d, A));
}

}  // namespace fork1s
