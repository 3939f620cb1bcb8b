#include "linalg/elimination.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "linalg/cholesky.hpp"

namespace fork1s {

namespace {

// Rows of one unit are near 1. What is left of one beside those before it is smaller than its distance from
// them by what they see of each other; with a thousand above the threshold of ranks (rank.hpp) nothing is in
// doubt.
constexpr double kClearPivot = 1e-3;
// Least share of the largest entry of a row that its pivot may have.
constexpr double kPivotShare = 0.3;
// Largest entry of Z: digits that closing loses.
constexpr double kLargestShare = 1e3;

}  // namespace

bool EliminatedNullSpace(const MatrixX& A, MatrixX& Z) {
  const Eigen::Index m = A.rows(), n = A.cols();
  if (m >= n) return false;
  RowMatrixX U = A;
  std::vector<int> rows_of(static_cast<std::size_t>(n), 0), pivot_of(static_cast<std::size_t>(n), -1);
  for (Eigen::Index j = 0; j < n; ++j)
    rows_of[static_cast<std::size_t>(j)] = static_cast<int>((A.col(j).array() != 0).count());
  std::vector<Eigen::Index> pivots(static_cast<std::size_t>(m));
  for (Eigen::Index k = 0; k < m; ++k) {
    double* __restrict row = U.data() + k * n;
    double largest = 0;
    for (Eigen::Index j = 0; j < n; ++j) largest = std::max(largest, std::abs(row[j]));
    if (!(largest > kClearPivot)) return false;
    // Of the large ones that which fewest rows depend on: a joint of one loop before one that loops share.
    Eigen::Index best = -1;
    for (Eigen::Index j = 0; j < n; ++j) {
      if (std::abs(row[j]) < kPivotShare * largest) continue;
      const int fewer =
          best < 0 ? 1 : rows_of[static_cast<std::size_t>(best)] - rows_of[static_cast<std::size_t>(j)];
      if (fewer > 0 || (fewer == 0 && std::abs(row[j]) > std::abs(row[best]))) best = j;
    }
    pivots[static_cast<std::size_t>(k)] = best;
    pivot_of[static_cast<std::size_t>(best)] = static_cast<int>(k);
    const double inverse = 1 / row[best];
    for (Eigen::Index j = 0; j < n; ++j) row[j] *= inverse;
    row[best] = 1;
    for (Eigen::Index i = 0; i < m; ++i) {
      double* __restrict other = U.data() + i * n;
      const double factor = other[best];
      if (i == k || factor == 0) continue;
      for (Eigen::Index j = 0; j < n; ++j) other[j] -= factor * row[j];
      other[best] = 0;
    }
  }
  if (m > 0 && !(U.cwiseAbs().maxCoeff() < kLargestShare)) return false;
  Z.setZero(n, n - m);
  for (Eigen::Index j = 0, next = 0; j < n; ++j) {
    if (pivot_of[static_cast<std::size_t>(j)] >= 0) continue;
    for (Eigen::Index k = 0; k < m; ++k) Z(pivots[static_cast<std::size_t>(k)], next) = -U(k, j);
    Z(j, next++) = 1;
  }
  return true;
}

double DivideByRoot(const MatrixX& B, MatrixX& Z) {
  const Eigen::Index k = B.cols();
  if (k == 0) return 0;
  MatrixX L(k, k);
  double off = 0;
  for (Eigen::Index j = 0; j < k; ++j) {
    auto rest = L.col(j).tail(k - j);
    rest.noalias() = B.rightCols(k - j).transpose() * B.col(j);
    off =
        std::max({off, std::abs(rest(0) - 1), k - j > 1 ? rest.tail(k - j - 1).cwiseAbs().maxCoeff() : 0.0});
  }
  if (!CholeskyInPlace(L) || !L.diagonal().allFinite()) return std::numeric_limits<double>::infinity();
  for (Eigen::Index j = 0; j < k; ++j) {
    if (j > 0) Z.col(j).noalias() -= Z.leftCols(j) * L.row(j).head(j).transpose();
    Z.col(j) /= L(j, j);
  }
  return off;
}

}  // namespace fork1s
