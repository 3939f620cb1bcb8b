#include "low_rank_mode_update.hpp"

#include <algorithm>
#include <fork1s/base/quad.hpp>

namespace fork1s::internal {
namespace {

// A dense factor of as many takes what one of all does for a hand and what it holds.
constexpr std::size_t kMostRows = 60;
// Linearizations begin where it left off (low_rank_mode_newton.cpp).
constexpr double kNearEnough = 1e3;

// A point's rows side by side: of w, and of the turning about the axes that bear a moment.
void SetRows(const PaddedRows& rows, const int* axes, int size, double (&out)[2][24]) {
  for (int k = 0; k < size; ++k) {
    double* to = out[k / 4] + k % 4;
    if (k < 3)
      for (int c = 0; c < 6; ++c) to[4 * c] = rows(c, k);
    else
      for (int c = 0; c < 3; ++c) to[4 * c] = rows(3 + c, axes[k - 3]);
  }
}

}  // namespace

void LowRankModeUpdate::Reserve(int freedoms) {
  members_.reserve(kMostRows);
  X_.reserve(4 * kMostRows * static_cast<std::size_t>(freedoms));
  s_.reserve(static_cast<std::size_t>(freedoms));
  ports_.reserve(2 * kMostRows);
  changes_.reserve(24 * 2 * kMostRows);
  for (std::vector<double>* v : {&Q_, &M_}) v->reserve(kMostRows * kMostRows + 4);
  for (std::vector<double>* v :
       {&w_, &lambda_, &r_, &w_start_, &lambda_start_, &off_, &step_, &w_step_, &right_})
    v->reserve(kMostRows + 4);
  changed_.reserve(kMostRows);
  for (std::vector<int>* v : {&pivots_, &active_}) v->reserve(kMostRows);
}

bool LowRankModeUpdate::Has(int index, bool is_limit) const {
  return std::any_of(members_.begin(), members_.end(),
                     [&](const Member& m) { return m.index == index && (m.pair < 0) == is_limit; });
}

int LowRankModeUpdate::PlaceOf(int port) {
  if (port < 0) return -1;
  const auto place = static_cast<std::size_t>(std::find(ports_.begin(), ports_.end(), port) - ports_.begin());
  if (place == ports_.size()) ports_.push_back(port);
  return static_cast<int>(place);
}

bool LowRankModeUpdate::Add(const RegularizedContactProblem& rows, int index, int pair) {
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
    m.factored.topLeftCorner<3, 3>() = point.linearization.D;
    for (int axis = 0; axis < 3; ++axis) {
      if (!point.moments.Has(axis)) continue;
      m.axes[m.size - 3] = axis;
      m.factored(m.size, 0) = point.linearization.turn_by_normal[axis];
      m.factored(m.size, m.size) = point.linearization.D_turn(axis, axis);
      ++m.size;
    }
  }
  const int count = count_ + m.size;
  // A factor of all is the smaller one where there are fewer freedoms.
  if (count > static_cast<int>(kMostRows) || count > rows.freedoms()) return false;
  if (pair >= 0) {
    const PointRows& point = rows.points[static_cast<std::size_t>(index)];
    const PairRows& of = rows.pairs[static_cast<std::size_t>(pair)];
    m.port_a = PlaceOf(of.port_a);
    m.port_b = PlaceOf(of.port_b);
    SetRows(point.rows_a, m.axes, m.size, m.J_a);
    SetRows(point.rows_b, m.axes, m.size, m.J_b);
  }
  members_.push_back(m);
  count_ = count;
  return true;
}

bool LowRankModeUpdate::Gather(const RegularizedContactProblem& rows, double enough) {
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

void LowRankModeUpdate::AddColumns(const RegularizedContactProblem& rows, DerivativeLu& lu) {
  const auto n = static_cast<std::size_t>(rows.freedoms()), count = static_cast<std::size_t>(count_);
  stride_ = (count + 3) / 4 * 4;
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
  Q_.assign(stride_ * count + 4, 0.0);
  M_.resize(count * count + 4);
  right_.resize(count + 4);
  pivots_.resize(count);
  changes_.resize(24 * ports_.size());
  const double* x = X_.data();
  for (const Member& by : members_)
    for (int g = 0; g < by.groups(); ++g, x += 4 * n) {
      for (std::size_t p = 0; p < ports_.size(); ++p)
        port_at(static_cast<int>(p)).FourChanges(x, changes_.data() + 24 * p);
      const int columns = std::min(by.size - 4 * g, 4);
      double* q = Q_.data() + static_cast<std::size_t>(by.begin + 4 * g) * stride_;
      const auto set = [&](int row, const Quad& values) {
        for (int c = 0; c < columns; ++c)
          q[static_cast<std::size_t>(c) * stride_ + static_cast<std::size_t>(row)] = values[c];
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
void LowRankModeUpdate::Read(const RegularizedContactProblem& rows) {
  for (std::vector<double>* v : {&w_, &lambda_, &r_, &off_, &step_})
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

bool LowRankModeUpdate::Solve(RegularizedContactProblem& rows, DerivativeLu& lu, std::vector<double>& d,
                              double enough) {
  Read(rows);
  AddColumns(rows, lu);
  if (!SolveInModes(rows, enough)) {
    Read(rows);
    if (!SolveByLineSearch(rows, kNearEnough * enough) || !SolveInModes(rows, enough)) return false;
  }
  std::vector<double>& s = s_;
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
  rows.MoveInFixedModes(s.data());
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
