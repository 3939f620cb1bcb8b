#include "newton.hpp"

#include <algorithm>
#include <cmath>

// Alart-Curnier equations on all rows at once, A = J W Jᵀ, u = A λ + b, r a momentum per velocity:
//     F_n = λ_n − z,                       z = max(0, λ_n − r u_n)
//     F_t = λ_t − Π_{|·| ≤ µ z}(λ_t − r u_t)
// One step solves the generalised derivative of F. An active normal row demands u_n = 0, a sticking pair
// u_t = 0, an open contact λ = 0, and a sliding pair, y = λ_t − r u_t, ŷ = y/|y|, ρ = µ z / |y| < 1,
//     dλ_t − µ ŷ (dλ_n − r du_n) − ρ (I − ŷ ŷᵀ)(dλ_t − r du_t) = −F_t.
namespace fork1s::internal {
namespace {

// Added to the diagonal of rows that demand a velocity (their diagonal is near 1): redundant contacts, such
// as the fourth corner of a box, make A singular, and this picks one of the solutions. It grows tenfold with
// every step that the line search refuses, which keeps steps along the null space short, and shrinks again.
constexpr double kLeastRegularisation = 1e-10, kFirstRaised = 1e-6, kMostRegularisation = 1;
constexpr double kFinest = 1e-8;  // of what is enough: below, rounding
constexpr int kLineSearchSteps = 5;
constexpr int kSweepsAfterStall = 50;

// Plain loops, not Eigen's: where Eigen starts its packets depends on the address, and with it the last bit.
void Subtract(double factor, const double* x, int n, double* __restrict y) {
  for (int i = 0; i < n; ++i) y[i] -= factor * x[i];
}

/// Solves G x = x in place by LU with row pivoting; false when a pivot vanishes. G is n x n, column-major.
bool SolveInPlace(double* G, int n, int* pivots, double* x) {
  for (int k = 0; k < n; ++k) {
    double* gk = G + static_cast<std::ptrdiff_t>(k) * n;
    int pivot = k;
    for (int i = k + 1; i < n; ++i) {
      if (std::abs(gk[i]) > std::abs(gk[pivot])) pivot = i;
    }
    if (!(std::abs(gk[pivot]) > 1e-300)) return false;
    pivots[k] = pivot;
    if (pivot != k) {
      for (int j = 0; j < n; ++j) {
        std::swap(G[static_cast<std::ptrdiff_t>(j) * n + k], G[static_cast<std::ptrdiff_t>(j) * n + pivot]);
      }
      std::swap(x[k], x[pivot]);
    }
    const int rest = n - k - 1;
    double* lower = gk + k + 1;
    for (int i = 0; i < rest; ++i) lower[i] /= gk[k];
    for (int j = k + 1; j < n; ++j) {
      double* gj = G + static_cast<std::ptrdiff_t>(j) * n;
      if (gj[k] != 0) Subtract(gj[k], lower, rest, gj + k + 1);
    }
    Subtract(x[k], lower, rest, x + k + 1);
  }
  for (int k = n - 1; k >= 0; --k) {
    const double* gk = G + static_cast<std::ptrdiff_t>(k) * n;
    x[k] /= gk[k];
    Subtract(x[k], gk, k, x);
  }
  return true;
}

}  // namespace

void NewtonSolver::Reserve(int num_rows) {
  const std::size_t n = static_cast<std::size_t>(num_rows);
  A_data_.reserve(n * n);
  G_data_.reserve(n * n);
  pivots_.reserve(n);
  for (std::vector<double>* v : {&b_, &x_, &trial_, &best_, &u_, &F_, &step_}) v->reserve(n);
}

void NewtonSolver::Assemble(const RowSet& rows) {
  const int contacts = static_cast<int>(rows.contacts.size());
  const int limits = static_cast<int>(rows.limits.size());
  const int moments = static_cast<int>(rows.moments.size());
  n_ = 3 * contacts + moments + limits;
  const std::size_t n = static_cast<std::size_t>(n_);
  A_data_.assign(n * n, 0.0);
  G_data_.resize(n * n);
  pivots_.resize(n);
  for (std::vector<double>* v : {&b_, &x_, &trial_, &best_, &u_, &F_, &step_}) v->assign(n, 0.0);

  // Column by column: what a unit impulse of constraint j does to every constraint.
  const auto add = [&](int column, int columns, const ResponsePart& part) {
    if (part.stride == 0) return;
    const double* data = rows.storage.data() + part.data;
    for (int i = 0; i < contacts; ++i) {
      const ContactRow& row = rows.contacts[static_cast<std::size_t>(i)];
      for (const auto& [port, J] : {std::pair(row.port_a, row.J_a), std::pair(row.port_b, row.J_b)}) {
        if (port < part.offset || port >= part.offset + part.size) continue;
        const Eigen::Map<const Eigen::Matrix<double, 4, 6>, Eigen::Aligned32> jacobian(J);
        for (int c = 0; c < columns; ++c) {
          const Eigen::Map<const Vector6> k(data + c * part.stride + (port - part.offset));
          const Vector4 du = jacobian.lazyProduct(k);
          Eigen::Map<Vector3>(A_data_.data() + static_cast<std::ptrdiff_t>(column + c) * n_ + 3 * i) +=
              du.head<3>();
        }
      }
    }
    for (int i = 0; i < moments; ++i) {
      const MomentRow& row = rows.moments[static_cast<std::size_t>(i)];
      for (const auto& [port, J] : {std::pair(row.port_a, &row.J_a), std::pair(row.port_b, &row.J_b)}) {
        if (port < part.offset || port >= part.offset + part.size) continue;
        for (int c = 0; c < columns; ++c) {
          const Eigen::Map<const Vector3> k(data + c * part.stride + (port - part.offset));
          A_data_[static_cast<std::size_t>(column + c) * n + static_cast<std::size_t>(3 * contacts + i)] +=
              J->dot(k);
        }
      }
    }
    for (int i = 0; i < limits; ++i) {
      const LimitRow& row = rows.limits[static_cast<std::size_t>(i)];
      if (row.row < part.offset || row.row >= part.offset + part.size) continue;
      for (int c = 0; c < columns; ++c) {
        A_data_[static_cast<std::size_t>(column + c) * n +
                static_cast<std::size_t>(3 * contacts + moments + i)] +=
            row.sign * data[c * part.stride + (row.row - part.offset)];
      }
    }
  };
  for (int j = 0; j < contacts; ++j) {
    const ContactRow& row = rows.contacts[static_cast<std::size_t>(j)];
    if (!row.live) continue;
    for (const ResponsePart& part : row.part) add(3 * j, 3, part);
  }
  for (int j = 0; j < moments; ++j) {
    const MomentRow& row = rows.moments[static_cast<std::size_t>(j)];
    if (!row.live) continue;
    for (const ResponsePart& part : row.part) add(3 * contacts + j, 1, part);
  }
  for (int j = 0; j < limits; ++j) {
    if (rows.limits[static_cast<std::size_t>(j)].live) {
      add(3 * contacts + moments + j, 1, rows.limits[static_cast<std::size_t>(j)].part);
    }
  }
}

void NewtonSolver::ReadImpulses(const RowSet& rows) {
  double* x = x_.data();
  for (const ContactRow& row : rows.contacts) x = std::copy_n(row.impulse, 3, x);
  for (const MomentRow& row : rows.moments) *x++ = row.impulse;
  for (const LimitRow& row : rows.limits) *x++ = row.impulse;
}

void NewtonSolver::WriteImpulses(const std::vector<double>& from, RowSet& rows) const {
  // The rows keep impulses inside the cone, so what Newton leaves outside by its tolerance is cut off.
  const double* x = from.data();
  for (ContactRow& row : rows.contacts) {
    if (row.live) {
      row.impulse[0] = std::max(0.0, x[0]);
      const double bound = row.law.friction * row.impulse[0], size = std::hypot(x[1], x[2]);
      const double shrink = size > bound ? bound / size : 1.0;
      row.impulse[1] = shrink * x[1];
      row.impulse[2] = shrink * x[2];
    }
    x += 3;
  }
  for (MomentRow& row : rows.moments) {
    if (row.live) row.impulse = row.Bounded(*x, rows.NormalImpulse(row));
    ++x;
  }
  for (LimitRow& row : rows.limits) {
    if (row.live) row.impulse = row.Bounded(*x);
    ++x;
  }
}

double NewtonSolver::Evaluate(const RowSet& rows, const std::vector<double>& x) {
  std::copy(b_.begin(), b_.end(), u_.begin());
  for (int j = 0; j < n_; ++j) {
    const double xj = x[static_cast<std::size_t>(j)];
    if (xj != 0) Subtract(-xj, A_data_.data() + static_cast<std::ptrdiff_t>(j) * n_, n_, u_.data());
  }
  double merit = 0;
  std::size_t i = 0;
  for (const ContactRow& row : rows.contacts) {
    double* F = F_.data() + i;
    const double* l = x.data() + i;
    const double* v = u_.data() + i;
    i += 3;
    F[0] = F[1] = F[2] = 0;
    if (!row.live) continue;
    const double r = row.newton_scale;
    const double z = std::max(0.0, l[0] - r * v[0]);
    double y1 = l[1] - r * v[1], y2 = l[2] - r * v[2];
    const double bound = row.law.friction * z, size = std::sqrt(y1 * y1 + y2 * y2);
    if (size > bound) {
      y1 *= bound / size;
      y2 *= bound / size;
    }
    F[0] = l[0] - z;
    F[1] = l[1] - y1;
    F[2] = l[2] - y2;
    merit += F[0] * F[0] + F[1] * F[1] + F[2] * F[2];
  }
  for (const MomentRow& row : rows.moments) {
    const double normal = x[static_cast<std::size_t>(3 * row.contact)];
    F_[i] = row.live ? (x[i] - row.Bounded(x[i] - row.inverse * u_[i], normal)) / row.arm : 0;
    merit += F_[i] * F_[i];
    ++i;
  }
  for (const LimitRow& row : rows.limits) {
    F_[i] = row.live ? x[i] - row.Bounded(x[i] - row.inverse * u_[i]) : 0;
    merit += F_[i] * F_[i];
    ++i;
  }
  return merit;
}

bool NewtonSolver::ComputeStep(const RowSet& rows) {
  using Rows = Eigen::Map<MatrixX>;
  using ConstRows = Eigen::Map<const MatrixX>;
  Rows G(G_data_.data(), n_, n_);
  const ConstRows A(A_data_.data(), n_, n_);
  G.setZero();
  int i = 0;
  for (const ContactRow& row : rows.contacts) {
    const int at = i;
    i += 3;
    const double* l = x_.data() + at;
    const double* u = u_.data() + at;
    const double r = row.newton_scale;
    const double zn = row.live ? l[0] - r * u[0] : 0;
    if (!(zn > 0)) {
      for (int k = 0; k < 3; ++k) G(at + k, at + k) = 1;
      continue;
    }
    G.row(at) = r * A.row(at);
    G(at, at) += regularisation_;
    const double y1 = l[1] - r * u[1], y2 = l[2] - r * u[2];
    const double size = std::sqrt(y1 * y1 + y2 * y2), bound = row.law.friction * zn;
    if (size <= bound) {
      for (int k = 1; k < 3; ++k) {
        G.row(at + k) = r * A.row(at + k);
        G(at + k, at + k) += regularisation_;
      }
      continue;
    }
    const double e1 = y1 / size, e2 = y2 / size, mu = row.law.friction, rho = bound / size;
    const double p11 = rho * (1 - e1 * e1), p12 = -rho * e1 * e2, p22 = rho * (1 - e2 * e2);
    G.row(at + 1) = r * (mu * e1 * A.row(at) + p11 * A.row(at + 1) + p12 * A.row(at + 2));
    G.row(at + 2) = r * (mu * e2 * A.row(at) + p12 * A.row(at + 1) + p22 * A.row(at + 2));
    G(at + 1, at) -= mu * e1;
    G(at + 2, at) -= mu * e2;
    G(at + 1, at + 1) += 1 - p11;
    G(at + 1, at + 2) -= p12;
    G(at + 2, at + 1) -= p12;
    G(at + 2, at + 2) += 1 - p22;
  }
  for (const MomentRow& row : rows.moments) {
    const int at = i++;
    const double x = x_[static_cast<std::size_t>(at)], normal = x_[static_cast<std::size_t>(3 * row.contact)];
    const double projected = x - row.inverse * u_[static_cast<std::size_t>(at)];
    if (row.live && row.Bounded(projected, normal) == projected) {
      G.row(at) = row.inverse / row.arm * A.row(at);
      G(at, at) += regularisation_;
      continue;
    }
    G(at, at) = 1 / row.arm;
    if (row.live && normal > 0) G(at, 3 * row.contact) = (projected > 0 ? -row.radius : row.radius) / row.arm;
  }
  for (const LimitRow& row : rows.limits) {
    const int at = i++;
    const double x = x_[static_cast<std::size_t>(at)], u = u_[static_cast<std::size_t>(at)];
    const double projected = x - row.inverse * u;
    if (row.live && projected > row.lower && projected < row.upper) {
      G.row(at) = row.inverse * A.row(at);
      G(at, at) += regularisation_;
    } else {
      G(at, at) = 1;
    }
  }
  for (std::size_t k = 0; k < F_.size(); ++k) step_[k] = -F_[k];
  if (!SolveInPlace(G_data_.data(), n_, pivots_.data(), step_.data())) return false;
  return Eigen::Map<const VectorX>(step_.data(), n_).allFinite();
}

int NewtonSolver::Solve(RowSet& rows, double enough, int max_iterations) {
  Assemble(rows);
  ReadImpulses(rows);
  best_ = x_;
  double best = rows.Residual();
  {
    std::swap(rows.velocity, rows.start);  // u at zero impulse
    alignas(32) double u[4];
    double* b = b_.data();
    for (const ContactRow& row : rows.contacts) {
      rows.ContactVelocity(row, u);
      b = std::copy_n(u, 3, b);
    }
    for (const MomentRow& row : rows.moments) *b++ = rows.MomentVelocity(row);
    for (const LimitRow& row : rows.limits) *b++ = rows.LimitVelocity(row);
    std::swap(rows.velocity, rows.start);
  }
  regularisation_ = kLeastRegularisation;
  int iteration = 0;
  while (iteration < max_iterations && best > kFinest * enough) {
    ++iteration;
    const double merit = Evaluate(rows, x_);
    bool moved = false;
    if (ComputeStep(rows)) {
      double length = 1;
      for (int k = 0; k < kLineSearchSteps && !moved; ++k, length *= 0.5) {
        for (std::size_t i = 0; i < x_.size(); ++i) trial_[i] = x_[i] + length * step_[i];
        moved = Evaluate(rows, trial_) < (1 - 1e-4 * length) * merit;
      }
    }
    if (moved) {
      std::swap(x_, trial_);
      regularisation_ = std::max(kLeastRegularisation, 0.1 * regularisation_);
      WriteImpulses(x_, rows);
      rows.ResetVelocity();
    } else {
      // A kink of F that the step cannot cross: let sweeps find another piece. Measured on random problems of
      // 20 contacts this solves three in four of those that plain Newton leaves.
      regularisation_ = std::clamp(10 * regularisation_, kFirstRaised, kMostRegularisation);
      WriteImpulses(x_, rows);
      rows.ResetVelocity();
      for (int k = 0; k < kSweepsAfterStall; ++k) rows.Sweep();
      ReadImpulses(rows);
    }
    const double residual = rows.Residual();
    // Once good enough, go on only while it pays: the last digits cost one cheap step or never come.
    const bool done = best <= enough && residual > 0.1 * best;
    if (residual < best) {
      best = residual;
      std::copy(x_.begin(), x_.end(), best_.begin());
    }
    if (done) break;
  }
  WriteImpulses(best_, rows);
  rows.ResetVelocity();
  return iteration;
}

}  // namespace fork1s::internal
