#include "tangent_rows.hpp"
#include "linalg/in_place.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/base/quad.hpp>

namespace fork1s::internal {
namespace {

// Share of its own square that tells a row from the multiple of another: far above the rounding in it, 1e-16.
// What is below is left to the sum, where ε shrinks it.
constexpr double kIndependent = 1e-6;
constexpr double kOfRows = 1e-12;  // ε, of the mean eigenvalue

}  // namespace

void TangentRows::Moved::Add(Span span) {
  if (span.size() == 0) return;
  int kept = 0;
  for (int k = 0; k < count; ++k)
    if (const Span other = spans[k]; other.end < span.begin || span.end < other.begin)
      spans[kept++] = other;
    else
      span = {std::min(span.begin, other.begin), std::max(span.end, other.end)};
  count = kept + 1;
  for (; kept > 0 && spans[kept - 1].begin > span.begin; --kept) spans[kept] = spans[kept - 1];
  spans[kept] = span;
}

int TangentRows::Moved::Common(const Moved& other, Span* out) const {
  int found = 0;
  for (int i = 0, j = 0; i < count && j < other.count;) {
    const Span &a = spans[i], &b = other.spans[j];
    const Span both{std::max(a.begin, b.begin), std::min(a.end, b.end)};
    if (both.size() > 0) out[found++] = both;
    ++(a.end < b.end ? i : j);
  }
  return found;
}

void TangentRows::Reserve(int contacts, int freedoms) {
  const auto points = static_cast<std::size_t>(contacts), n = static_cast<std::size_t>(freedoms);
  for (std::vector<Moved>* v : {&moved_, &of_group_}) v->reserve(points);
  fading_.reserve(points);
  members_.reserve(points);
  cover_.reserve(n);
  rows_.reserve((n + 4) * n);
  K_.reserve((n + 4) * (n + 4));
  for (std::vector<double>* v : {&x_, &y_}) v->reserve(n + 4);
}

void TangentRows::FindMoved(const RegularizedContactProblem& rows) {
  freedoms_ = rows.freedoms();
  moved_.resize(rows.pairs.size());
  fading_.assign(rows.pairs.size(), 0);
  cover_.assign(static_cast<std::size_t>(freedoms_), 0);
  for (std::size_t p = 0; p < rows.pairs.size(); ++p) {
    const PairRows& pair = rows.pairs[p];
    for (int i = pair.first; i < pair.first + pair.count; ++i)
      fading_[p] += rows.points[static_cast<std::size_t>(i)].previous.fades ? 1 : 0;
    if (fading_[p] == 0) continue;
    Moved& moved = moved_[p];
    moved.count = 0;
    for (const int index : {pair.port_a, pair.port_b}) {
      if (index < 0) continue;
      const PortRows& port = rows.ports[static_cast<std::size_t>(index)];
      moved.Add({port.begin, port.begin + port.freedoms});
      moved.Add({port.begin_apart, port.begin_apart + port.freedoms_apart});
    }
    for (int k = 0; k < moved.count; ++k)
      for (int f = moved.spans[k].begin; f < moved.spans[k].end; ++f) ++cover_[static_cast<std::size_t>(f)];
  }
}

void TangentRows::Clear(const Moved& moved, double* rows_of_four) const {
  for (int k = 0; k < moved.count; ++k)
    for (int f = moved.spans[k].begin; f < moved.spans[k].end; ++f) QuadAt(rows_of_four + 4 * f).setZero();
}

void TangentRows::Gather(const RegularizedContactProblem& rows, const Member* members, int count, int column,
                         double* to) {
  const PairRows& pair = rows.pairs[static_cast<std::size_t>(members->pair)];
  const auto add = [&](int index, PaddedRows PointRows::*own) {
    if (index < 0) return;
    double tangents[24] = {};
    for (int i = 0; i < count; ++i) {
      const PointRows& point = rows.points[static_cast<std::size_t>(members[i].point)];
      const double root = std::sqrt(point.PreviousBound());
      for (int c = 0; c < 6; ++c)
        for (int t = 0; t < 2; ++t) tangents[4 * c + column + 2 * i + t] = root * (point.*own)(c, 1 + t);
    }
    rows.ports[static_cast<std::size_t>(index)].AddFourTo(tangents, to);
  };
  add(pair.port_a, &PointRows::rows_a);
  add(pair.port_b, &PointRows::rows_b);
}

bool TangentRows::IsDetermined(const RegularizedContactProblem& rows, const Member& member) {
  const Moved& moved = moved_[static_cast<std::size_t>(member.pair)];
  const auto is_alone = [&](int freedom) { return cover_[static_cast<std::size_t>(freedom)] == 1; };
  double xx = 0, xy = 0, yy = 0;
  bool is_known = false;
  for (int k = 0; k < moved.count; ++k)
    for (int f = moved.spans[k].begin; f < moved.spans[k].end; ++f) {
      if (!is_alone(f)) continue;
      if (!is_known) {
        is_known = true;
        rows_.resize(std::max(rows_.size(), 4 * static_cast<std::size_t>(freedoms_)));
        Clear(moved, rows_.data());
        Gather(rows, &member, 1, 0, rows_.data());
      }
      const double x = rows_[static_cast<std::size_t>(4 * f)], y = rows_[static_cast<std::size_t>(4 * f + 1)];
      xx += x * x;
      xy += x * y;
      yy += y * y;
    }
  const PointRows& point = rows.points[static_cast<std::size_t>(member.point)];
  const double all = 3 * point.compliance.inverse_mass * point.PreviousBound();
  // The smaller of the two eigenvalues is no less than the determinant over the trace.
  return xx * yy - xy * xy > kIndependent * all * (xx + yy);
}

int TangentRows::DropDetermined(RegularizedContactProblem& rows, int fading) {
  FindMoved(rows);
  for (bool any = true; any && fading > 0;) {
    any = false;
    for (std::size_t p = 0; p < moved_.size(); ++p) {
      if (fading_[p] != 1) continue;
      int i = rows.pairs[p].first;
      while (!rows.points[static_cast<std::size_t>(i)].previous.fades) ++i;
      if (!IsDetermined(rows, {i, static_cast<int>(p)})) continue;
      rows.points[static_cast<std::size_t>(i)].previous.fades = false;
      fading_[p] = 0;
      for (int k = 0; k < moved_[p].count; ++k)
        for (int f = moved_[p].spans[k].begin; f < moved_[p].spans[k].end; ++f)
          --cover_[static_cast<std::size_t>(f)];
      --fading;
      any = true;
    }
  }
  return fading;
}

// K = g gᵀ on and below the diagonal, which is what FactorCholesky reads; returns its trace.
double TangentRows::AddProducts(int groups) {
  const std::ptrdiff_t size = 4 * groups, of_four = 4 * static_cast<std::ptrdiff_t>(freedoms_);
  double trace = 0;
  for (std::ptrdiff_t j = 0; j < groups; ++j)
    for (std::ptrdiff_t i = j; i < groups; ++i) {
      Span common[16];
      const int spans =
          of_group_[static_cast<std::size_t>(i)].Common(of_group_[static_cast<std::size_t>(j)], common);
      Quad c0 = Quad::Zero(), c1 = c0, c2 = c0, c3 = c0;
      for (int k = 0; k < spans; ++k) {
        const double *x = rows_.data() + i * of_four + 4 * common[k].begin,
                     *y = rows_.data() + j * of_four + 4 * common[k].begin;
        for (int f = common[k].size(); f > 0; --f, x += 4, y += 4) {
          const Quad some = QuadAt(x);
          c0 += y[0] * some;
          c1 += y[1] * some;
          c2 += y[2] * some;
          c3 += y[3] * some;
        }
      }
      double* K = K_.data() + 4 * j * size + 4 * i;
      QuadAt(K) = c0;
      QuadAt(K + size) = c1;
      QuadAt(K + 2 * size) = c2;
      QuadAt(K + 3 * size) = c3;
      if (i == j) trace += c0[0] + c1[1] + c2[2] + c3[3];
    }
  return trace;
}

bool TangentRows::FindLeast(RegularizedContactProblem& rows, int count) {
  const int groups = (count + 1) / 2, size = 4 * groups;
  const auto m = static_cast<std::size_t>(size);
  members_.clear();
  for (std::size_t p = 0; p < rows.pairs.size(); ++p) {
    if (fading_[p] == 0) continue;
    for (int i = rows.pairs[p].first; i < rows.pairs[p].first + rows.pairs[p].count; ++i)
      if (rows.points[static_cast<std::size_t>(i)].previous.fades)
        members_.push_back({i, static_cast<int>(p)});
  }
  rows_.resize(std::max(rows_.size(), m * static_cast<std::size_t>(freedoms_)));
  K_.resize(m * m);
  x_.assign(m, 0.0);
  of_group_.resize(static_cast<std::size_t>(groups));
  for (std::size_t g = 0; g < of_group_.size(); ++g) {
    const Member* first = members_.data() + 2 * g;
    double* to = rows_.data() + 4 * g * static_cast<std::size_t>(freedoms_);
    Moved& moved = of_group_[g] = moved_[static_cast<std::size_t>(first->pair)];
    const int own = std::min(2, count - 2 * static_cast<int>(g));
    const bool is_one_pair = own < 2 || first[1].pair == first->pair;
    if (!is_one_pair) {
      const Moved& other = moved_[static_cast<std::size_t>(first[1].pair)];
      for (int k = 0; k < other.count; ++k) moved.Add(other.spans[k]);
    }
    Clear(moved, to);
    if (is_one_pair) {
      Gather(rows, first, own, 0, to);
    } else {
      Gather(rows, first, 1, 0, to);
      Gather(rows, first + 1, 1, 2, to);
    }
  }
  const double trace = AddProducts(groups);
  if (!(trace > 0)) return false;
  const double proximal = kOfRows * trace / freedoms_;
  for (std::size_t k = 0; k < m; ++k) K_[k * (m + 1)] += proximal;
  for (std::size_t k = 0; k < members_.size(); ++k) {
    const PointRows& point = rows.points[static_cast<std::size_t>(members_[k].point)];
    for (std::size_t t = 0; t < 2; ++t)
      x_[2 * k + t] = point.previous.tangents[t] / std::sqrt(point.PreviousBound());
  }
  if (!FactorCholesky(K_.data(), size)) return false;
  for (int round = 0; round < 2; ++round) {
    y_ = x_;
    SolveWithCholesky(K_.data(), size, y_.data());
    for (std::size_t k = 0; k < m; ++k) x_[k] -= proximal * y_[k];
  }
  for (std::size_t k = 0; k < members_.size(); ++k) {
    PointRows& point = rows.points[static_cast<std::size_t>(members_[k].point)];
    for (std::size_t t = 0; t < 2; ++t)
      point.previous.least[t] = std::sqrt(point.PreviousBound()) * x_[2 * k + t];
  }
  return true;
}

}  // namespace fork1s::internal
