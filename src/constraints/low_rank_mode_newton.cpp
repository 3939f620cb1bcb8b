// The law at a few points by themselves (low_rank_mode_update.hpp): Newton's method on its modes, (w, λ) side by side,
// and where they take turns in w alone with a line search. With D' of the mode at hand and off = λ + D' w
// what it does not bear yet,
//     (1 + (D' − D) Q) δ = −off,   w += Q δ,   λ += δ − D Q δ,   r += δ
#include <algorithm>
#include <cmath>
#include <fork1s/base/quad.hpp>

#include "linalg/in_place.hpp"
#include "line_search.hpp"
#include "low_rank_mode_update.hpp"

namespace fork1s::internal {
namespace {

// It ends at rounding where it can: what a mode ends short of by a thousandth of `enough`, impulses that
// redundant points bear against each other are off by a thousand times as much.
constexpr double kRounded = 1e-3;
constexpr int kFewSteps = 12, kLineSteps = 30;

}  // namespace

double LowRankModeUpdate::UpdateLimit(const LimitRows& limit, Member& m) {
  const auto at = static_cast<std::size_t>(m.begin);
  const BoundLaw& law = limit.law;
  const double y = law.Trial(lambda_[at], w_[at], limit.inverse_mass), off = lambda_[at] - law.Project(y);
  const bool inside = law.IsWithin(y);
  m.more(0, 0) = (inside ? 1 / law.R : 0) - m.factored(0, 0);
  off_[at] = inside ? lambda_[at] + w_[at] / law.R : off;
  return limit.inverse_mass * off * off;
}

double LowRankModeUpdate::UpdatePoint(const PointRows& point, Member& m) {
  const double *w = w_.data() + m.begin, *lambda = lambda_.data() + m.begin;
  double* off = off_.data() + m.begin;
  const Eigen::Map<const Vector3> w3(w), lambda3(lambda);
  const double normal = point.law.TrialNormal(lambda[0], w[0], point.compliance.inverse_mass);
  Matrix6& D = m.more;
  D.setZero();
  m.is_open = !(normal > 0);
  Vector3 off3 = lambda3;
  double gap2 = 0;
  if (!m.is_open) {
    const FrictionCone::Trial y = point.law.NaturalTrial(normal, lambda3, w3, point.compliance.inverse_mass);
    off3 -= point.law.Project(y);
    Matrix3 D3;
    // As for all (contact_modes.cpp).
    point.law.Linearize(y, y.Slides() && !(y.tangent.dot(lambda3.tail<2>()) < 0), D3);
    D.topLeftCorner<3, 3>() = D3;
    for (int k = 3; k < m.size; ++k) {
      const int axis = m.axes[k - 3];
      const BoundLaw law = point.moments.At(axis, normal);
      const double moment = law.Trial(lambda[k], w[k], point.compliance.inverse_inertia[axis]),
                   gap = lambda[k] - law.Project(moment);
      gap2 += point.compliance.inverse_inertia[axis] * gap * gap;
      if (law.IsWithin(moment))
        D(k, k) = 1 / law.R;
      else
        D(k, 0) = point.moments.ByNormal(axis, moment) / point.law.R_n;
    }
  }
  gap2 += point.compliance.inverse_mass * off3.squaredNorm();
  Eigen::Map<Vector3>{off} = lambda3 + D.topLeftCorner<3, 3>() * w3;
  for (int k = 3; k < m.size; ++k) off[k] = lambda[k] + D(k, k) * w[k] + D(k, 0) * w[0];
  D -= m.factored;
  return gap2;
}

double LowRankModeUpdate::RespondPoint(const PointRows& point, Member& m) {
  const double *w = w_.data() + m.begin, *lambda = lambda_.data() + m.begin;
  double* off = off_.data() + m.begin;
  const FrictionCone::Trial trial = point.law.AtVelocity(Eigen::Map<const Vector3>(w));
  const Vector3 law = point.law.Project(trial);
  Matrix3 D3;
  point.law.Derivative(trial, D3);
  m.more.setZero();
  m.more.topLeftCorner<3, 3>() = D3;
  const Vector3 off3 = Eigen::Map<Vector3>{off} = Eigen::Map<const Vector3>(lambda) - law;
  double off2 = point.compliance.inverse_mass * off3.squaredNorm();
  for (int k = 3; k < m.size; ++k) {
    const int axis = m.axes[k - 3];
    const BoundLaw bounds = point.moments.At(axis, law[0]);
    const double y = -w[k] / bounds.R;
    off[k] = lambda[k] - bounds.Project(y);
    off2 += point.compliance.inverse_inertia[axis] * off[k] * off[k];
    if (bounds.IsWithin(y))
      m.more(k, k) = 1 / bounds.R;
    else if (law[0] > 0)
      m.more(k, 0) = point.moments.ByNormal(axis, y) / point.law.R_n;
  }
  m.more -= m.factored;
  return off2;
}

// Pieces that (w, λ) are on; off_ = λ + D w, what they do not bear yet. How far from the law that is.
double LowRankModeUpdate::UpdateModes(const RegularizedContactProblem& rows) {
  double gap2 = 0;
  for (Member& m : members_)
    gap2 += m.pair < 0 ? UpdateLimit(rows.limits[static_cast<std::size_t>(m.index)], m)
                       : UpdatePoint(rows.points[static_cast<std::size_t>(m.index)], m);
  return std::sqrt(gap2);
}

// The law as a function of w alone; off_ = λ less what it says.
double LowRankModeUpdate::Respond(const RegularizedContactProblem& rows) {
  double off2 = 0;
  for (Member& m : members_) {
    if (m.pair >= 0) {
      off2 += RespondPoint(rows.points[static_cast<std::size_t>(m.index)], m);
      continue;
    }
    const LimitRows& limit = rows.limits[static_cast<std::size_t>(m.index)];
    const auto at = static_cast<std::size_t>(m.begin);
    const double y = -w_[at] / limit.law.R;
    off_[at] = lambda_[at] - limit.law.Project(y);
    m.more(0, 0) = (limit.law.IsWithin(y) ? 1 / limit.law.R : 0) - m.factored(0, 0);
    off2 += limit.inverse_mass * off_[at] * off_[at];
  }
  return std::sqrt(off2);
}

// (1 + (D' − D) Q) step = −off, and what it does to w. Where D' = D the step is known at once.
bool LowRankModeUpdate::FindStep() {
  active_.clear();
  changed_.clear();
  w_step_.assign(stride_ + 4, 0.0);
  // w_step_ += Q step of its rows
  const auto add_response = [&](const Member& m) {
    const std::size_t stride = stride_;
    const double *q = ColumnOf(m.begin), *step = step_.data() + m.begin;
    double* w = w_step_.data();
    int left = m.size;
    for (; left >= 3; left -= 3, q += 3 * stride, step += 3) {
      const double s0 = step[0], s1 = step[1], s2 = step[2];
      for (std::size_t i = 0; i < stride; i += 4) {
        Quad sum = QuadAt(w + i);
        sum += s0 * QuadAt(q + i);
        sum += s1 * QuadAt(q + stride + i);
        sum += s2 * QuadAt(q + 2 * stride + i);
        QuadAt(w + i) = sum;
      }
    }
    for (; left > 0; --left, q += stride, ++step)
      for (std::size_t i = 0; i < stride; i += 4) QuadAt(w + i) += *step * QuadAt(q + i);
  };
  for (const Member& m : members_) {
    for (int i = m.begin; i < m.begin + m.size; ++i)
      step_[static_cast<std::size_t>(i)] = -off_[static_cast<std::size_t>(i)];
    if (m.more.topLeftCorner(m.size, m.size).isZero(0)) {
      add_response(m);
      continue;
    }
    changed_.push_back(&m);
    for (int i = m.begin; i < m.begin + m.size; ++i) active_.push_back(i);
  }
  if (active_.empty()) return true;
  const std::size_t active = active_.size();
  // D' − D of the changed times their rows of a column. Four rows are written at a time: what is past a point's last
  // the next point writes again.
  const auto by_changes = [&](const double* column, double* to) {
    for (const Member* m : changed_) {
      const double *q = column + m->begin, *E = m->more.data();
      const int size = m->size;
      if (size == 1) {
        *to++ = *E * *q;
        continue;
      }
      QuadAt(to) = q[0] * QuadAt(E) + (q[1] * QuadAt(E + 6) + q[2] * QuadAt(E + 12));
      if (size > 3)  // moments: by their own turning, and by the normal speed
        QuadAt(to + 3) = Quad(E[21], E[28], E[35], 0).cwiseProduct(QuadAt(q + 3)) + q[0] * QuadAt(E + 3);
      to += size;
    }
  };
  for (std::size_t c = 0; c < active; ++c) by_changes(ColumnOf(active_[c]), M_.data() + c * active);
  by_changes(w_step_.data(), right_.data());
  for (std::size_t i = 0; i < active; ++i) {
    M_[i * (active + 1)] += 1;
    right_[i] = step_[static_cast<std::size_t>(active_[i])] - right_[i];
  }
  if (!FactorLu(M_.data(), static_cast<int>(active), pivots_.data())) return false;
  SolveWithLu(M_.data(), static_cast<int>(active), pivots_.data(), right_.data());
  for (std::size_t i = 0; i < active; ++i) step_[static_cast<std::size_t>(active_[i])] = right_[i];
  for (const Member* m : changed_) add_response(*m);
  return true;
}

// From the start of the step on, that much of it.
void LowRankModeUpdate::Move(double length) {
  for (const Member& m : members_) {
    const double* by = w_step_.data() + m.begin;
    for (int i = 0; i < m.size; ++i) {
      double D_w = 0;
      for (int k = 0; k < m.size; ++k) D_w += m.factored(i, k) * by[k];
      const auto at = static_cast<std::size_t>(m.begin + i);
      lambda_[at] = lambda_start_[at] + length * (step_[at] - D_w);
      w_[at] = w_start_[at] + length * w_step_[at];
    }
  }
}

bool LowRankModeUpdate::SolveInModes(const RegularizedContactProblem& rows, double enough) {
  double before = 1e300;
  for (int k = 0; k < kFewSteps; ++k) {
    const double gap = UpdateModes(rows);
    if (gap <= kRounded * enough || (gap <= enough && !(gap < 0.5 * before))) return true;
    before = gap;
    if (!FindStep()) return false;
    w_start_ = w_;
    lambda_start_ = lambda_;
    Move(1);
    for (std::size_t i = 0; i < r_.size(); ++i) r_[i] += step_[i];
  }
  return UpdateModes(rows) <= enough;
}

// Newton's method in w alone, with a line search to the root of s·F (regularized_newton.cpp): s = X step, F =
// G_Cᵀ off.
bool LowRankModeUpdate::SolveByLineSearch(const RegularizedContactProblem& rows, double enough) {
  double off = Respond(rows), best = 1e300;
  int best_at = 0;
  const auto along = [&] {
    double sum = 0;
    for (std::size_t i = 0; i < off_.size(); ++i) sum += w_step_[i] * off_[i];
    return sum;
  };
  for (int k = 0; k < kLineSteps; ++k) {
    if (off <= enough) return true;
    if (off < 0.5 * best) {
      best = off;
      best_at = k;
    } else if (k - best_at > kFewSteps) {
      return false;
    }
    if (!FindStep()) return false;
    w_start_ = w_;
    lambda_start_ = lambda_;
    const double start = along();
    const auto evaluate = [&](double length) {
      Move(length);
      off = Respond(rows);
      return along();
    };
    const double length = FindSlopeRoot(start, evaluate(1), evaluate);
    for (std::size_t i = 0; i < r_.size(); ++i) r_[i] += length * step_[i];
  }
  return false;
}

}  // namespace fork1s::internal
