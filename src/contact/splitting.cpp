#include "splitting.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/linalg/cholesky.hpp>

// Alternating direction method of multipliers with de Saxcé's correction, after Carpentier, Le Lidec and
// Montaut, "From Compliant to Rigid Contact Simulation: a Unified and Efficient Approach" (2024). In impulses
// scaled so that every contact's own inverse mass is near 1, G = D A D, g = D b, K the friction cones:
//     (G + (η + ρ) I) x⁺ = η x + ρ y + z − g − Γ(z),   y⁺ = Π_K(x⁺ − z/ρ),   z⁺ = z − ρ (x⁺ − y⁺)
// where z becomes the velocity u + Γ(u), Γ(u) = µ |u_t| on the normal row. It needs neither a regular A nor a
// good start, and gains a digit in some tens of iterations; Newton then has the right pieces of the law to
// finish on.
namespace fork1s::internal {
namespace {

constexpr double kProximal = 1e-6;  // η, beside eigenvalues of G that reach about the number of contacts
constexpr double kFirstExponent = 0.05, kExponentStep = 0.05;  // of ρ = √(L η) (L/η)^p
constexpr double kImbalance = 10;                              // between the two residuals, before ρ moves
constexpr int kPatience = 8;                                   // iterations between moves of ρ

using Matrix = Eigen::Map<MatrixX>;
using Vector = Eigen::Map<VectorX>;

}  // namespace

void SplittingSolver::Reserve(int num_rows) {
  const std::size_t n = static_cast<std::size_t>(num_rows);
  G_.reserve(n * n);
  factor_.reserve(n * n);
  for (std::vector<double>* v : {&d_, &g_, &x_, &y_, &z_, &y_before_, &rhs_}) v->reserve(n);
}

void SplittingSolver::Scale(const RowSet& rows, const std::vector<double>& A, const std::vector<double>& b) {
  n_ = static_cast<int>(b.size());
  const std::size_t n = b.size();
  G_.resize(n * n);
  factor_.resize(n * n);
  for (std::vector<double>* v : {&d_, &g_, &x_, &y_, &z_, &y_before_, &rhs_}) v->assign(n, 0.0);
  std::size_t i = 0;
  for (const ContactRow& row : rows.contacts) {
    for (int k = 0; k < 3; ++k, ++i) {
      d_[i] = row.live ? std::sqrt(row.newton_scale) : 0;
      if (row.live) x_[i] = row.impulse[k] / d_[i];
    }
  }
  for (const MomentRow& row : rows.moments) {
    d_[i] = row.live ? std::sqrt(row.inverse) : 0;
    if (row.live) x_[i] = row.impulse / d_[i];
    ++i;
  }
  for (const LimitRow& row : rows.limits) {
    d_[i] = row.live ? std::sqrt(row.inverse) : 0;
    if (row.live) x_[i] = row.impulse / d_[i];
    ++i;
  }
  for (std::size_t c = 0; c < n; ++c) {
    g_[c] = d_[c] * b[c];
    for (std::size_t r = 0; r < n; ++r) G_[c * n + r] = 0.5 * d_[r] * d_[c] * (A[c * n + r] + A[r * n + c]);
  }
}

void SplittingSolver::Project(const RowSet& rows, const double* x, double* y) const {
  const double* const first = y;
  for (const ContactRow& row : rows.contacts) {
    const double mu = row.law.friction, n = x[0], t = std::hypot(x[1], x[2]);
    double shrink = 1;
    y[0] = n;
    if (!row.live || mu * t <= -n) {
      y[0] = shrink = 0;
    } else if (t > mu * n) {
      y[0] = (n + mu * t) / (1 + mu * mu);
      shrink = t > 0 ? mu * y[0] / t : 0;
    }
    y[1] = shrink * x[1];
    y[2] = shrink * x[2];
    x += 3;
    y += 3;
  }
  for (const MomentRow& row : rows.moments) {
    const double d = std::sqrt(row.inverse);
    const auto at = static_cast<std::size_t>(3 * row.contact);
    *y++ = row.live ? row.Bounded(d * *x, d_[at] * first[at]) / d : 0;
    ++x;
  }
  for (const LimitRow& row : rows.limits) {
    const double d = std::sqrt(row.inverse);  // impulses here are scaled by 1 / d
    *y++ = row.live ? row.Bounded(d * *x) / d : 0;
    ++x;
  }
}

void SplittingSolver::AddCorrection(const RowSet& rows, const double* z, double* out) const {
  for (const ContactRow& row : rows.contacts) {
    if (row.live) out[0] += row.law.friction * std::hypot(z[1], z[2]);
    out += 3;
    z += 3;
  }
}

int SplittingSolver::Solve(RowSet& rows, const std::vector<double>& A, const std::vector<double>& b,
                           double enough, int max_iterations) {
  Scale(rows, A, b);
  return Iterate(rows, false, enough, max_iterations);
}

int SplittingSolver::SolveSafely(RowSet& rows, const std::vector<double>& A, const std::vector<double>& b,
                                 double enough, int max_iterations) {
  Scale(rows, A, b);
  // Of the inverse mass that a contact feels: what a wedge of many contacts needs to stay below a thousand
  // times the momentum at hand.
  constexpr double kGive = 1e-3;
  for (int k = 0; k < n_; ++k) G_[static_cast<std::size_t>(k) * static_cast<std::size_t>(n_ + 1)] += kGive;
  std::size_t i = 0;
  for (const ContactRow& row : rows.contacts) {
    g_[i] -= d_[i] * std::min(0.0, row.bias[0]);
    i += 3;
  }
  i += rows.moments.size();
  for (const LimitRow& row : rows.limits) {
    g_[i] -= d_[i] * std::min(0.0, row.bias);
    ++i;
  }
  std::fill(x_.begin(), x_.end(), 0.0);  // what failed is no start
  return Iterate(rows, true, enough, max_iterations);
}

int SplittingSolver::Iterate(RowSet& rows, bool associated, double enough, int max_iterations) {
  const Matrix G(G_.data(), n_, n_);
  Matrix factor(factor_.data(), n_, n_);
  Vector x(x_.data(), n_), y(y_.data(), n_), z(z_.data(), n_), rhs(rhs_.data(), n_), g(g_.data(), n_);
  // No eigenvalue is larger than the largest row sum.
  double L = 0;
  for (Eigen::Index i = 0; i < n_; ++i) L = std::max(L, G.col(i).cwiseAbs().sum());
  if (!(L > 0) || !std::isfinite(L)) return 0;
  const double spread = std::max(10.0, L / kProximal);
  double rho = std::sqrt(L * kProximal) * std::pow(spread, kFirstExponent);
  const double move = std::pow(spread, kExponentStep);

  Project(rows, x_.data(), y_.data());
  z.noalias() = G * y;
  z += g;
  rhs.setZero();
  if (!associated) AddCorrection(rows, z_.data(), rhs_.data());
  z += rhs;
  bool factored = false;
  int since_move = 0, iteration = 0;
  while (iteration < max_iterations) {
    ++iteration;
    if (!factored) {
      factor = G;
      factor.diagonal().array() += kProximal + rho;
      if (!CholeskyInPlace(factor)) break;
      factored = true;
    }
    rhs.setZero();
    if (!associated) AddCorrection(rows, z_.data(), rhs_.data());
    rhs = kProximal * x + rho * y + z - g - rhs;
    SolveWithLowerInPlace(factor, rhs);
    x = rhs;
    y_before_.swap(y_);
    new (&y) Vector(y_.data(), n_);
    rhs = x - z / rho;
    Project(rows, rhs_.data(), y_.data());
    z -= rho * (x - y);

    const Vector before(y_before_.data(), n_);
    const double primal = (x - y).cwiseAbs().maxCoeff();
    const double dual = rho * (y - before).cwiseAbs().maxCoeff();
    const double impulses = y.cwiseAbs().maxCoeff(),
                 speeds = std::max(g.cwiseAbs().maxCoeff(), z.cwiseAbs().maxCoeff());
    if (!std::isfinite(primal + dual)) break;
    if (primal <= enough * impulses && dual <= enough * speeds) break;
    if (++since_move < kPatience) continue;
    const double ratio = primal * speeds - kImbalance * dual * impulses > 0   ? move
                         : dual * impulses - kImbalance * primal * speeds > 0 ? 1 / move
                                                                              : 1;
    if (ratio == 1) continue;
    rho *= ratio;
    factored = false;
    since_move = 0;
  }

  std::size_t i = 0;
  for (ContactRow& row : rows.contacts)
    for (int k = 0; k < 3; ++k, ++i)
      if (row.live) row.impulse[k] = std::isfinite(y_[i]) ? d_[i] * y_[i] : 0;
  for (MomentRow& row : rows.moments) {
    if (row.live) row.impulse = std::isfinite(y_[i]) ? d_[i] * y_[i] : 0;
    ++i;
  }
  for (LimitRow& row : rows.limits) {
    if (row.live) row.impulse = std::isfinite(y_[i]) ? d_[i] * y_[i] : 0;
    ++i;
  }
  rows.ResetVelocity();
  return iteration;
}

}  // namespace fork1s::internal
