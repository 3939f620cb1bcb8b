#include "few_rows.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/linalg/in_place.hpp>

#include "piece_of_law.hpp"

namespace fork1s::internal {
namespace {

constexpr std::size_t kMostRows = 60;
constexpr double kRounded = 1e-3;  // of enough: rounding
constexpr int kFewSteps = 12, kLineSteps = 30, kBrackets = 30;

// A row of a point on the twist of one of its ports: of w, or of the turning about an axis.
Vector6 RowOf(const Matrix36& J, int row, int axis) {
  if (row < 3) return J.row(row).transpose();
  Vector6 turning = Vector6::Zero();
  turning.head<3>() = J.row(axis).tail<3>().transpose();
  return turning;
}

}  // namespace

void FewRows::Reserve(int freedoms) {
  members_.reserve(kMostRows);
  X_.reserve(kMostRows * static_cast<std::size_t>(freedoms));
  s_.reserve(std::max(2 * kMostRows, static_cast<std::size_t>(freedoms)));
  for (std::vector<double>* v : {&Q_, &M_}) v->reserve(kMostRows * kMostRows);
  for (std::vector<double>* v : {&w_, &lambda_, &r_, &w_start_, &lambda_start_, &off_, &step_, &w_step_})
    v->reserve(kMostRows);
  pivots_.reserve(kMostRows);
}

bool FewRows::Has(int index, bool is_limit) const {
  return std::any_of(members_.begin(), members_.end(),
                     [&](const Member& m) { return m.index == index && (m.pair < 0) == is_limit; });
}

bool FewRows::Add(const CompliantRows& rows, int index, int pair) {
  Member m;
  m.index = index;
  m.pair = pair;
  m.begin = count_;
  if (pair < 0) {
    m.size = 1;
    m.factored(0, 0) = rows.limits[static_cast<std::size_t>(index)].D;
  } else {
    const PointRows& point = rows.points[static_cast<std::size_t>(index)];
    m.size = 3;
    m.factored.topLeftCorner<3, 3>() = point.D;
    for (int axis = 0; axis < 3; ++axis) {
      if (!(point.Radius(axis) > 0)) continue;
      m.axes[m.size - 3] = axis;
      m.factored(m.size, 0) = point.by_normal[axis];
      m.factored(m.size, m.size) = point.D_turn(axis, axis);
      ++m.size;
    }
  }
  const int count = count_ + m.size;
  if (count > static_cast<int>(kMostRows) || count > rows.freedoms()) return false;
  members_.push_back(m);
  count_ = count;
  return true;
}

bool FewRows::Gather(const CompliantRows& rows, double enough) {
  if (members_.empty()) count_ = columns_ = 0;
  const int before = count_;
  const double each2 = enough * enough / static_cast<double>(rows.points.size() + rows.limits.size());
  for (std::size_t p = 0; p < rows.pairs.size(); ++p) {
    const PairRows& pair = rows.pairs[p];
    for (int i = pair.first; i < pair.first + pair.count; ++i)
      if (rows.points[static_cast<std::size_t>(i)].off2 > each2 && !Has(i, false) &&
          !Add(rows, i, static_cast<int>(p)))
        return false;
  }
  for (std::size_t i = 0; i < rows.limits.size(); ++i)
    if (rows.limits[i].off2 > each2 && !Has(static_cast<int>(i), true) && !Add(rows, static_cast<int>(i), -1))
      return false;
  return count_ > before;
}

void FewRows::AddColumns(CompliantRows& rows, DerivativeLu& lu) {
  const auto n = static_cast<std::size_t>(rows.freedoms()), count = static_cast<std::size_t>(count_);
  X_.resize(count * n);
  Q_.resize(count * count);
  const auto port_at = [&](int index) -> PortRows& { return rows.ports[static_cast<std::size_t>(index)]; };
  for (const Member& m : members_) {
    if (m.begin < columns_) continue;
    for (int k = 0; k < m.size; ++k) {
      double* x = X_.data() + static_cast<std::size_t>(m.begin + k) * n;
      std::fill_n(x, n, 0.0);
      if (m.pair < 0) {
        const LimitRows& limit = rows.limits[static_cast<std::size_t>(m.index)];
        for (int i = 0; i < limit.freedoms; ++i) x[limit.begin + i] = limit.sign * limit.Y[i];
      } else {
        const PairRows& pair = rows.pairs[static_cast<std::size_t>(m.pair)];
        const PointRows& point = rows.points[static_cast<std::size_t>(m.index)];
        const int axis = k < 3 ? 0 : m.axes[k - 3];
        if (pair.port_a >= 0) port_at(pair.port_a).AddTo(RowOf(point.J_a, k, axis), x);
        if (pair.port_b >= 0) port_at(pair.port_b).AddTo(RowOf(point.J_b, k, axis), x);
      }
      lu.Solve(rows, x);
    }
  }
  columns_ = count_;
  for (std::size_t c = 0; c < count; ++c) {
    const double* x = X_.data() + c * n;
    double* q = Q_.data() + c * count;
    for (PortRows& port : rows.ports) port.SetChange(x);
    for (const Member& m : members_) {
      if (m.pair < 0) {
        const LimitRows& limit = rows.limits[static_cast<std::size_t>(m.index)];
        double sum = 0;
        for (int i = 0; i < limit.freedoms; ++i) sum += limit.Y[i] * x[limit.begin + i];
        q[m.begin] = limit.sign * sum;
        continue;
      }
      const PairRows& pair = rows.pairs[static_cast<std::size_t>(m.pair)];
      const PointRows& point = rows.points[static_cast<std::size_t>(m.index)];
      Vector3 w = Vector3::Zero();
      if (pair.port_a >= 0) w += point.J_a.lazyProduct(port_at(pair.port_a).change);
      if (pair.port_b >= 0) w += point.J_b.lazyProduct(port_at(pair.port_b).change);
      Eigen::Map<Vector3>(q + m.begin) = w;
      for (int k = 3; k < m.size; ++k) {
        double turning = 0;
        if (pair.port_a >= 0) turning += RowOf(point.J_a, k, m.axes[k - 3]).dot(port_at(pair.port_a).change);
        if (pair.port_b >= 0) turning += RowOf(point.J_b, k, m.axes[k - 3]).dot(port_at(pair.port_b).change);
        q[m.begin + k] = turning;
      }
    }
  }
}

// w and λ as they are; ports' changes are those of the last measurement.
void FewRows::Read(const CompliantRows& rows) {
  for (std::vector<double>* v : {&w_, &lambda_, &r_, &off_, &step_, &w_step_})
    v->assign(static_cast<std::size_t>(count_), 0.0);
  for (const Member& m : members_) {
    double *w = w_.data() + m.begin, *lambda = lambda_.data() + m.begin;
    if (m.pair < 0) {
      const LimitRows& limit = rows.limits[static_cast<std::size_t>(m.index)];
      *w = limit.w;
      *lambda = limit.impulse;
      continue;
    }
    const PairRows& pair = rows.pairs[static_cast<std::size_t>(m.pair)];
    const PointRows& point = rows.points[static_cast<std::size_t>(m.index)];
    Eigen::Map<Vector3>{w} = rows.Speed(pair, point);
    Eigen::Map<Vector3>{lambda} = point.impulse;
    if (m.size == 3) continue;
    const Vector3 turning = rows.Turning(pair, point);
    for (int k = 3; k < m.size; ++k) {
      w[k] = turning[m.axes[k - 3]];
      lambda[k] = point.moment[m.axes[k - 3]];
    }
  }
}

double FewRows::TakeLimit(const LimitRows& limit, Member& m) {
  const auto at = static_cast<std::size_t>(m.begin);
  const double y = lambda_[at] - (w_[at] + limit.R * lambda_[at]) / (limit.inverse_mass + limit.R);
  const double kept = std::clamp(y, limit.lower, limit.upper), off = lambda_[at] - kept;
  const bool inside = y > limit.lower && y < limit.upper;
  m.more(0, 0) = (inside ? 1 / limit.R : 0) - m.factored(0, 0);
  off_[at] = inside ? lambda_[at] + w_[at] / limit.R : off;
  return limit.inverse_mass * off * off;
}

double FewRows::TakePoint(const PointRows& point, Member& m) {
  const double *w = w_.data() + m.begin, *lambda = lambda_.data() + m.begin;
  double* off = off_.data() + m.begin;
  const Eigen::Map<const Vector3> w3(w), lambda3(lambda);
  const PointReading read = ReadPoint(point, w3, lambda3);
  double gap2 = point.inverse_mass * read.gap2;
  Matrix6& D = m.more;
  D.setZero();
  m.is_open = read.IsOpen();
  if (!m.is_open) {
    Matrix3 D3;
    // As for all (pieces.cpp).
    if (read.size <= read.bound || read.y.dot(lambda3.tail<2>()) < 0)
      SetSticking(point, D3);
    else
      SetSliding(point, read, D3);
    D.topLeftCorner<3, 3>() = D3;
    for (int k = 3; k < m.size; ++k) {
      const int axis = m.axes[k - 3];
      const double R = point.AngularR(axis, point.law.R_t),
                   y = lambda[k] - (w[k] + R * lambda[k]) / (point.inverse_inertia[axis] + R),
                   most = point.Radius(axis) * read.y_n, gap = lambda[k] - std::clamp(y, -most, most);
      gap2 += point.inverse_inertia[axis] * gap * gap;
      if (std::abs(y) <= most)
        D(k, k) = 1 / R;
      else
        D(k, 0) = (y > 0 ? point.Radius(axis) : -point.Radius(axis)) / point.law.R_n;
    }
  }
  Eigen::Map<Vector3>{off} = lambda3 + D.topLeftCorner<3, 3>() * w3;
  for (int k = 3; k < m.size; ++k) off[k] = lambda[k] + D(k, k) * w[k] + D(k, 0) * w[0];
  D -= m.factored;
  return gap2;
}

double FewRows::RespondPoint(const PointRows& point, Member& m) {
  const double *w = w_.data() + m.begin, *lambda = lambda_.data() + m.begin;
  double* off = off_.data() + m.begin;
  Vector3 law;
  Matrix3 D3;
  double use = 0;
  internal::Respond(point.law, Eigen::Map<const Vector3>(w), law, D3, use);
  m.more.setZero();
  m.more.topLeftCorner<3, 3>() = D3;
  const Vector3 off3 = Eigen::Map<Vector3>{off} = Eigen::Map<const Vector3>(lambda) - law;
  double off2 = point.inverse_mass * off3.squaredNorm();
  for (int k = 3; k < m.size; ++k) {
    const int axis = m.axes[k - 3];
    const double R = point.AngularR(axis, point.law.R_t), x = -w[k] / R, most = point.Radius(axis) * law[0];
    off[k] = lambda[k] - std::clamp(x, -most, most);
    off2 += point.inverse_inertia[axis] * off[k] * off[k];
    if (most > 0 && std::abs(x) <= most)
      m.more(k, k) = 1 / R;
    else if (most > 0)
      m.more(k, 0) = (x > 0 ? point.Radius(axis) : -point.Radius(axis)) / point.law.R_n;
  }
  m.more -= m.factored;
  return off2;
}

// Pieces that (w, λ) are on; off_ = λ + D w, what they do not bear yet. How far from the law that is.
double FewRows::TakePieces(const CompliantRows& rows) {
  double gap2 = 0;
  for (Member& m : members_)
    gap2 += m.pair < 0 ? TakeLimit(rows.limits[static_cast<std::size_t>(m.index)], m)
                       : TakePoint(rows.points[static_cast<std::size_t>(m.index)], m);
  return std::sqrt(gap2);
}

// The law as a function of w alone; off_ = λ less what it says.
double FewRows::Respond(const CompliantRows& rows) {
  double off2 = 0;
  for (Member& m : members_) {
    if (m.pair >= 0) {
      off2 += RespondPoint(rows.points[static_cast<std::size_t>(m.index)], m);
      continue;
    }
    const LimitRows& limit = rows.limits[static_cast<std::size_t>(m.index)];
    const auto at = static_cast<std::size_t>(m.begin);
    const double x = -w_[at] / limit.R, kept = std::clamp(x, limit.lower, limit.upper);
    off_[at] = lambda_[at] - kept;
    m.more(0, 0) = (kept == x ? 1 / limit.R : 0) - m.factored(0, 0);
    off2 += limit.inverse_mass * off_[at] * off_[at];
  }
  return std::sqrt(off2);
}

// (1 + (D' − D) Q) step = −off, and what it does to w.
bool FewRows::FindStep() {
  const auto count = static_cast<std::size_t>(count_);
  M_.assign(count * count, 0.0);
  const Eigen::Map<const MatrixX> Q(Q_.data(), count_, count_);
  for (const Member& m : members_)
    for (int c = 0; c < count_; ++c) {
      const double* q = Q_.data() + c * count_ + m.begin;
      double* to = M_.data() + c * count_ + m.begin;
      if (m.size == 1) {
        to[0] = m.more(0, 0) * q[0];
        continue;
      }
      Eigen::Map<Vector3>{to} = m.more.topLeftCorner<3, 3>().lazyProduct(Eigen::Map<const Vector3>(q));
      for (int k = 3; k < m.size; ++k) to[k] = m.more(k, 0) * q[0] + m.more(k, k) * q[k];
    }
  for (std::size_t i = 0; i < count; ++i) M_[i * (count + 1)] += 1;
  pivots_.resize(count);
  for (std::size_t i = 0; i < count; ++i) step_[i] = -off_[i];
  if (!FactorLu(M_.data(), count_, pivots_.data())) return false;
  SolveWithLu(M_.data(), count_, pivots_.data(), step_.data());
  std::fill(w_step_.begin(), w_step_.end(), 0.0);
  for (int c = 0; c < count_; ++c)
    for (int i = 0; i < count_; ++i)
      w_step_[static_cast<std::size_t>(i)] += Q(i, c) * step_[static_cast<std::size_t>(c)];
  return true;
}

// From the start of the step on, that much of it.
void FewRows::Move(double length) {
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

bool FewRows::ByPieces(const CompliantRows& rows, double enough) {
  double before = 1e300;
  for (int k = 0; k < kFewSteps; ++k) {
    const double gap = TakePieces(rows);
    if (gap <= kRounded * enough || (gap <= enough && !(gap < 0.5 * before))) return true;
    before = gap;
    if (!FindStep()) return false;
    w_start_ = w_;
    lambda_start_ = lambda_;
    Move(1);
    for (std::size_t i = 0; i < r_.size(); ++i) r_[i] += step_[i];
  }
  return TakePieces(rows) <= enough;
}

// Newton's method in w alone, with a line search to the root of s·F (compliant_newton.cpp): s = X step, F =
// G_Cᵀ off.
bool FewRows::ByLine(const CompliantRows& rows, double enough) {
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
    double length = 1;
    Move(1);
    off = Respond(rows);
    double slope = along();
    if (start < 0 && slope > 0.1 * std::abs(start)) {
      double low = 0, f_low = start, high = 1, f_high = slope;
      int side = 0;
      for (int b = 0; b < kBrackets && std::abs(slope) > 0.1 * std::abs(start); ++b) {
        length = low + (high - low) * f_low / (f_low - f_high);
        if (!(length > low && length < high)) length = 0.5 * (low + high);
        Move(length);
        off = Respond(rows);
        slope = along();
        if (slope > 0) {
          high = length;
          f_high = slope;
          if (side == 1) f_low *= 0.5;
          side = 1;
        } else {
          low = length;
          f_low = slope;
          if (side == -1) f_high *= 0.5;
          side = -1;
        }
      }
    }
    for (std::size_t i = 0; i < r_.size(); ++i) r_[i] += length * step_[i];
  }
  return false;
}

bool FewRows::Solve(CompliantRows& rows, DerivativeLu& lu, std::vector<double>& d, double enough) {
  Read(rows);
  AddColumns(rows, lu);
  const std::vector<double>&w = w_, &lambda = lambda_;
  std::vector<double>& s = s_;
  s.assign(w.begin(), w.end());
  s.insert(s.end(), lambda.begin(), lambda.end());
  if (!ByPieces(rows, enough)) {
    const auto back = [&] {
      std::copy_n(s.begin(), w_.size(), w_.begin());
      std::copy_n(s.begin() + static_cast<std::ptrdiff_t>(w_.size()), w_.size(), lambda_.begin());
      std::fill(r_.begin(), r_.end(), 0.0);
    };
    back();
    if (!ByLine(rows, 1e3 * enough)) return false;
    if (!ByPieces(rows, enough)) return false;
  }
  const std::size_t n = d.size();
  s.assign(n, 0.0);
  for (std::size_t c = 0; c < r_.size(); ++c) {
    const double* x = X_.data() + c * n;
    for (std::size_t i = 0; i < n; ++i) s[i] += r_[c] * x[i];
  }
  for (std::size_t i = 0; i < n; ++i) d[i] += s[i];
  rows.MoveOnPieces(s.data());
  for (const Member& m : members_) {
    const double* r = r_.data() + m.begin;
    if (m.pair < 0) {
      rows.limits[static_cast<std::size_t>(m.index)].impulse += *r;
      continue;
    }
    PointRows& point = rows.points[static_cast<std::size_t>(m.index)];
    if (m.is_open) {  // to the last digit
      point.impulse.setZero();
      point.moment.setZero();
      continue;
    }
    point.impulse += Eigen::Map<const Vector3>(r);
    for (int k = 3; k < m.size; ++k) point.moment[m.axes[k - 3]] += r[k];
  }
  return true;
}

}  // namespace fork1s::internal
