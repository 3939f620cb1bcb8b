
#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/QR>

#include "linalg/null_space.hpp"
#include "linalg/spectrum.hpp"

namespace fork1s {
namespace {

// Diagonals of pivoted QR follow the singular values within a factor of the square root of the size (rare
// constructed matrices aside): with this much between them the decision is the same.
constexpr double kClearDiagonal = 1e6;

// Descending by construction, up to the last digit.
VectorX Diagonal(const Eigen::ColPivHouseholderQR<MatrixX>& qr) {
  return qr.matrixQR().diagonal().cwiseAbs();
}

bool Clear(const Rank& rank) { return !rank.doubtful() && rank.gap() > kClearDiagonal; }

}  // namespace

NullSpace ComputeNullSpace(const MatrixX& A) {
  const Eigen::Index n = A.cols();
  NullSpace out;
  if (A.rows() == 0 || n == 0 || A.isZero(0)) {
    out.seen.resize(n, 0);
    out.unseen = MatrixX::Identity(n, n);
    return out;
  }
  const Eigen::ColPivHouseholderQR<MatrixX> qr(A.transpose());
  out.rank = DecideRank(Diagonal(qr));
  MatrixX basis;
  if (Clear(out.rank)) {
    basis = qr.householderQ() * MatrixX::Identity(n, n);
  } else {
    const SingularSpectrum svd = RightSingular(A);
    out.rank = DecideRank(svd.values);
    basis = svd.vectors;
    if (out.rank.doubtful()) {
      const bool last_kept =
          out.rank.value > 0 && out.rank.kept * out.rank.dropped <= kRankThreshold * kRankThreshold;
      out.doubtful = basis.col(std::min(n - 1, Eigen::Index{out.rank.value} - (last_kept ? 1 : 0)));
    }
  }
  out.seen = basis.leftCols(out.rank.value);
  out.unseen = basis.rightCols(n - out.rank.value);
  const auto& order = qr.colsPermutation().indices();
  out.independent_rows.assign(order.data(), order.data() + out.rank.value);
  std::sort(out.independent_rows.begin(), out.independent_rows.end());
  return out;
}

MatrixX OrthogonalComplement(const MatrixX& Y) {
  const Eigen::Index n = Y.rows();
  if (Y.cols() == 0) return MatrixX::Identity(n, n);
  const Eigen::HouseholderQR<MatrixX> qr(Y);
  return (qr.householderQ() * MatrixX::Identity(n, n)).rightCols(n - Y.cols());
}

MatrixX EchelonBasis(MatrixX B) {
  for (Eigen::Index k = 0; k < B.cols(); ++k) {
    Eigen::Index row, column;
    B.rightCols(B.cols() - k).cwiseAbs().maxCoeff(&row, &column);
    B.col(k).swap(B.col(k + column));
    B.col(k) /= B(row, k);
    for (Eigen::Index j = 0; j < B.cols(); ++j)
      if (j != k) B.col(j) -= B(row, j) * B.col(k);
  }
  // What elimination left of zeros is rounding; and the largest entry may have moved.
  B = (B.array().abs() < 1e-9).select(0.0, B);
  for (Eigen::Index k = 0; k < B.cols(); ++k) {
    Eigen::Index largest;
    B.col(k).cwiseAbs().maxCoeff(&largest);
    B.col(k) /= B(largest, k);
  }
  return B;
}

MatrixX RangeBasis(const MatrixX& A) { return ComputeNullSpace(A.transpose()).seen; }

namespace {

// Rows of B in descending order of size.
std::vector<Eigen::Index> RowOrder(const MatrixX& B) {
  std::vector<Eigen::Index> order(static_cast<std::size_t>(B.rows()));
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  const VectorX size = B.rowwise().squaredNorm();
  std::stable_sort(order.begin(), order.end(),
                   [&](Eigen::Index i, Eigen::Index j) { return size(i) > size(j); });
  return order;
}

Eigen::ColPivHouseholderQR<MatrixX> GradedQr(const MatrixX& B, const std::vector<Eigen::Index>& order) {
  MatrixX sorted(B.rows(), B.cols());
  for (Eigen::Index i = 0; i < B.rows(); ++i) sorted.row(i) = B.row(order[static_cast<std::size_t>(i)]);
  return Eigen::ColPivHouseholderQR<MatrixX>(sorted);
}

}  // namespace

MatrixX OrthonormalisingFactor(const MatrixX& B) {
  const Eigen::Index n = B.cols();
  if (n == 0) return MatrixX(0, 0);
  const auto qr = GradedQr(B, RowOrder(B));
  MatrixX inverse = MatrixX::Identity(n, n);
  qr.matrixQR().topRows(n).triangularView<Eigen::Upper>().solveInPlace(inverse);
  return qr.colsPermutation() * inverse;
}

MatrixX GradedRangeBasis(const MatrixX& B) {
  const Eigen::Index m = B.rows(), n = B.cols();
  if (n == 0) return MatrixX(m, 0);
  const auto order = RowOrder(B);
  const auto qr = GradedQr(B, order);
  const MatrixX sorted = qr.householderQ() * MatrixX::Identity(m, n);
  MatrixX basis(m, n);
  for (Eigen::Index i = 0; i < m; ++i) basis.row(order[static_cast<std::size_t>(i)]) = sorted.row(i);
  return basis;
}

}  // namespace fork1s
