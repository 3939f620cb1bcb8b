// Singular values by one-sided Jacobi rotations in extended precision.
//
// The plainest decomposition that reveals ranks: it shares nothing with the library's and keeps small
// singular values to their own relative precision.
#pragma once

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include <Eigen/Core>

namespace fork1s::linkages {

using Real = long double;
using MatrixL = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
using VectorL = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

/// B = U diag(sigma) Vᵀ, sigma falling, V square (n x n); U holds n columns, zero where sigma is.
struct Svd {
  MatrixL U, V;
  VectorL sigma;
};

inline Svd JacobiSvd(MatrixL B) {
  const Eigen::Index m = B.rows(), n = B.cols();
  Svd out;
  MatrixL V = MatrixL::Identity(n, n);
  const Real tiny = 1e-21L * B.norm();
  bool turned = m > 0;
  for (int sweep = 0; sweep < 60 && turned; ++sweep) {
    turned = false;
    for (Eigen::Index i = 0; i + 1 < n; ++i)
      for (Eigen::Index j = i + 1; j < n; ++j) {
        Real* x = B.col(i).data();
        Real* y = B.col(j).data();
        Real xx = 0, yy = 0, xy = 0;
        for (Eigen::Index k = 0; k < m; ++k) xx += x[k] * x[k], yy += y[k] * y[k], xy += x[k] * y[k];
        // The larger column first, so that they end in falling order.
        const bool swap = yy > xx;
        if (std::sqrt(std::min(xx, yy)) <= tiny || std::abs(xy) <= 1e-18L * std::sqrt(xx * yy)) {
          if (swap) {
            B.col(i).swap(B.col(j));
            V.col(i).swap(V.col(j));
            turned = true;
          }
          continue;
        }
        const Real zeta = (yy - xx) / (2 * xy);
        const Real t = (zeta < 0 ? -1 : 1) / (std::abs(zeta) + std::sqrt(1 + zeta * zeta));
        const Real c = 1 / std::sqrt(1 + t * t), s = c * t;
        auto rotate = [&](Real* p, Real* q, Eigen::Index size) {
          for (Eigen::Index k = 0; k < size; ++k) {
            const Real a = p[k], b = q[k];
            p[k] = c * a - s * b;
            q[k] = s * a + c * b;
          }
        };
        rotate(x, y, m);
        rotate(V.col(i).data(), V.col(j).data(), n);
        turned = true;
      }
  }
  VectorL norms(n);
  for (Eigen::Index i = 0; i < n; ++i) norms(i) = m > 0 ? B.col(i).norm() : 0;
  std::vector<Eigen::Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return norms(a) > norms(b); });
  out.U = MatrixL::Zero(m, n);
  out.V.resize(n, n);
  out.sigma.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index from = order[static_cast<std::size_t>(i)];
    out.sigma(i) = norms(from);
    out.V.col(i) = V.col(from);
    if (norms(from) > 0) out.U.col(i) = B.col(from) / norms(from);
  }
  return out;
}

}  // namespace fork1s::linkages
