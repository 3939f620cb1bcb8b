#include <fork1s/linalg/elimination.hpp>

#include <algorithm>
#include <cmath>
#include <fork1s/linalg/cholesky.hpp>
#include <limits>
#include <numeric>
#include <vector>

namespace fork1s {

namespace {

// Rows of one unit are near 1. What is left of one beside those before it is smaller than its distance from
// them by what they see of each other; with a thousand above the threshold of ranks (rank.hpp) nothing is in
// doubt.
constexpr double kClearPivot = 1e-3;
// Largest entry of Z: digits that closing loses.
constexpr double kLargestShare = 1e3;

}  // namespace

bool EliminatedNullSpace(MatrixX A, MatrixX& Z) {
  const Eigen::Index m = A.rows(), n = A.cols();
  if (m >= n) return false;
  std::vector<Eigen::Index> order(static_cast<std::size_t>(n));  // columns: m pivots, then the others
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  const auto column = [&](Eigen::Index k) { return A.data() + order[static_cast<std::size_t>(k)] * m; };
  for (Eigen::Index k = 0; k < m; ++k) {
    Eigen::Index best = k;
    for (Eigen::Index j = k + 1; j < n; ++j)
      if (std::abs(column(j)[k]) > std::abs(column(best)[k])) best = j;
    std::swap(order[static_cast<std::size_t>(k)], order[static_cast<std::size_t>(best)]);
    double* __restrict pivot = column(k);
    if (!(std::abs(pivot[k]) > kClearPivot)) return false;
    const double inverse = 1 / pivot[k];
    for (Eigen::Index i = k + 1; i < m; ++i) pivot[i] *= inverse;
    for (Eigen::Index j = k + 1; j < n; ++j) {
      double* __restrict other = column(j);
      const double factor = other[k];
      if (factor == 0) continue;  // a loop hears few coordinates
      for (Eigen::Index i = k + 1; i < m; ++i) other[i] -= factor * pivot[i];
    }
  }
  Z.setZero(n, n - m);
  for (Eigen::Index j = m; j < n; ++j) {
    double* __restrict other = column(j);
    for (Eigen::Index k = m - 1; k >= 0; --k) {
      const double* __restrict pivot = column(k);
      if (other[k] == 0) continue;
      const double value = other[k] /= pivot[k];
      if (!(std::abs(value) < kLargestShare)) return false;
      for (Eigen::Index i = 0; i < k; ++i) other[i] -= value * pivot[i];
      Z(order[static_cast<std::size_t>(k)], j - m) = -value;
    }
    Z(order[static_cast<std::size_t>(j)], j - m) = 1;
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
