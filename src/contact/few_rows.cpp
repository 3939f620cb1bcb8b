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

// A point's rows side by side: of w, and of the turning about the axes that bear a moment.
void SetRows(const Matrix36& J, const int* axes, int size, double (&out)[2][24]) {
  for (int k = 0; k < size; ++k) {
    double* to = out[k / 4] + k % 4;
    if (k < 3)
      for (int c = 0; c < 6; ++c) to[4 * c] = J(k, c);
    else
      for (int c = 0; c < 3; ++c) to[4 * c] = J(axes[k - 3], 3 + c);
  }
}

}  // namespace

void FewRows::Reserve(int freedoms) {
  members_.reserve(kMostRows);
  X_.reserve(4 * kMostRows * static_cast<std::size_t>(freedoms));
  s_.reserve(std::max(2 * kMostRows, static_cast<std::size_t>(freedoms)));
  ports_.reserve(2 * kMostRows);
  changes_.reserve(24 * 2 * kMostRows);
  for (std::vector<double>* v : {&Q_, &M_}) v->reserve(kMostRows * kMostRows);
  for (std::vector<double>* v : {&w_, &lambda_, &r_, &w_start_, &lambda_start_, &off_, &step_, &w_step_})
    v->reserve(kMostRows);
  pivots_.reserve(kMostRows);
}

bool FewRows::Has(int index, bool is_limit) const {
  return std::any_of(members_.begin(), members_.end(),
                     [&](const Member& m) { return m.index == index && (m.pair < 0) == is_limit; });
}

int FewRows::PlaceOf(int port) {
  if (port < 0) return -1;
  const auto place = static_cast<std::size_t>(std::find(ports_.begin(), ports_.end(), port) - ports_.begin());
  if (place == ports_.size()) ports_.push_back(port);
  return static_cast<int>(place);
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
  if (pair >= 0) {
    const PointRows& point = rows.points[static_cast<std::size_t>(index)];
    const PairRows& of = rows.pairs[static_cast<std::size_t>(pair)];
    m.port_a = PlaceOf(of.port_a);
    m.port_b = PlaceOf(of.port_b);
    SetRows(point.J_a, m.axes, m.size, m.J_a);
    SetRows(point.J_b, m.axes, m.size, m.J_b);
  }
  members_.push_back(m);
  count_ = count;
  return true;
}

bool FewRows::Gather(const CompliantRows& rows, double enough) {
  if (members_.empty()) {
    count_ = 0;
    with_columns_ = 0;
    ports_.clear();
    X_.clear();
  }
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

void FewRows::AddColumns(const CompliantRows& rows, DerivativeLu& lu) {
  const auto n = static_cast<std::size_t>(rows.freedoms()), count = static_cast<std::size_t>(count_);
  const auto port_at = [&](int place) -> const PortRows& {
    return rows.ports[static_cast<std::size_t>(ports_[static_cast<std::size_t>(place)])];
  };
  for (; with_columns_ < members_.size(); ++with_columns_) {
    const Member& m = members_[with_columns_];
    for (int g = 0; g < m.groups(); ++g) {
      X_.resize(X_.size() + 4 * n, 0.0);
      double* x = X_.data() + X_.size() - 4 * n;
      if (m.pair < 0) {
        const LimitRows& limit = rows.limits[static_cast<std::size_t>(m.index)];
        for (int i = 0; i < limit.freedoms; ++i) x[4 * (limit.begin + i)] = limit.sign * limit.Y[i];
      }
      if (m.port_a >= 0) port_at(m.port_a).AddFourTo(m.J_a[g], x);
      if (m.port_b >= 0) port_at(m.port_b).AddFourTo(m.J_b[g], x);
      lu.SolveFour(rows, x);
    }
  }
  Q_.resize(count * count);
  changes_.resize(24 * ports_.size());
  const double* x = X_.data();
  for (const Member& by : members_)
    for (int g = 0; g < by.groups(); ++g, x += 4 * n) {
      for (std::size_t p = 0; p < ports_.size(); ++p)
        port_at(static_cast<int>(p)).FourChanges(x, changes_.data() + 24 * p);
      const int columns = std::min(by.size - 4 * g, 4);
      double* q = Q_.data() + static_cast<std::size_t>(by.begin + 4 * g) * count;
      const auto set = [&](int row, const Quad& values) {
        for (int c = 0; c < columns; ++c)
          q[static_cast<std::size_t>(c) * count + static_cast<std::size_t>(row)] = values[c];
      };
      for (const Member& m : members_) {
        if (m.pair < 0) {
          const LimitRows& limit = rows.limits[static_cast<std::size_t>(m.index)];
          Quad sum = Quad::Zero();
          for (int i = 0; i < limit.freedoms; ++i)
            sum += limit.sign * limit.Y[i] * QuadAt(x + 4 * (limit.begin + i));
          set(m.begin, sum);
          continue;
        }
        for (int k = 0; k < m.size; ++k) {
          Quad sum = Quad::Zero();
          const auto add = [&](int place, const double(&J)[2][24]) {
            if (place < 0) return;
            const double *change = changes_.data() + 24 * place, *row = J[k / 4] + k % 4;
            for (int c = 0; c < 6; ++c) sum += row[4 * c] * QuadAt(change + 4 * c);
          };
          add(m.port_a, m.J_a);
          add(m.port_b, m.J_b);
          set(m.begin + k, sum);
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
  const double* x = X_.data();
  for (const Member& m : members_)
    for (int g = 0; g < m.groups(); ++g, x += 4 * n) {
      Quad r = Quad::Zero();
      for (int k = 4 * g; k < std::min(m.size, 4 * g + 4); ++k)
        r[k - 4 * g] = r_[static_cast<std::size_t>(m.begin + k)];
      for (std::size_t i = 0; i < n; ++i) s[i] += r.dot(QuadAt(x + 4 * i));
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
