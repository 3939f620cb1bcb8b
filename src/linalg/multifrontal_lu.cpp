#include <fork1s/linalg/multifrontal_lu.hpp>

#include <algorithm>
#include <fork1s/base/error.hpp>
#include <fork1s/base/quad.hpp>
#include <numeric>
#include <set>

#include "linalg/in_place.hpp"

namespace fork1s {
namespace {

// A diagonal entry below this share of the largest one in its column is no pivot.
constexpr double kPivotThreshold = 0.1;

// Blocks that a front eliminates, then those that they couple with.
struct Elimination {
  std::vector<int> own, rest;
};

// Minimum degree, counted in rows. Blocks that couple with the same others are eliminated together.
std::vector<Elimination> OrderOfElimination(const std::vector<int>& sizes,
                                            const std::vector<std::pair<int, int>>& couplings) {
  const auto count = static_cast<int>(sizes.size());
  std::vector<std::set<int>> adjacent(sizes.size());  // to each block that is left, itself included
  const auto near = [&](int i) -> std::set<int>& { return adjacent[static_cast<std::size_t>(i)]; };
  std::set<int> left;
  for (int i = 0; i < count; ++i) {
    near(i).insert(i);
    left.insert(i);
  }
  for (const auto& [i, j] : couplings) {
    near(i).insert(j);
    near(j).insert(i);
  }
  const auto degree = [&](int i) {
    int rows = 0;
    for (const int j : near(i)) rows += sizes[static_cast<std::size_t>(j)];
    return rows;
  };
  std::vector<Elimination> order;
  while (!left.empty()) {
    const int next =
        *std::min_element(left.begin(), left.end(), [&](int a, int b) { return degree(a) < degree(b); });
    const std::set<int> front = near(next);
    Elimination step;
    for (const int i : front) (near(i) == front ? step.own : step.rest).push_back(i);
    for (const int i : step.own) left.erase(i);
    for (const int i : step.rest) {
      near(i).insert(step.rest.begin(), step.rest.end());
      for (const int k : step.own) near(i).erase(k);
    }
    order.push_back(std::move(step));
  }
  return order;
}

}  // namespace

MultifrontalLu::MultifrontalLu(const std::vector<int>& sizes,
                               const std::vector<std::pair<int, int>>& couplings)
    : front_of_(sizes.size(), -1) {
  std::vector<int> first(sizes.size() + 1, 0);  // row of A of each block
  std::partial_sum(sizes.begin(), sizes.end(), first.begin() + 1);
  const std::vector<Elimination> order = OrderOfElimination(sizes, couplings);
  std::size_t values = 0;
  int rows = 0, pivots = 0, largest = 0;
  for (const Elimination& step : order) {
    Front front;
    front.begin = values;
    front.first_row = rows;
    front.first_pivot = pivots;
    blocks_.emplace_back();
    const auto append = [&](int block) {
      const int size = sizes[static_cast<std::size_t>(block)];
      blocks_.back().emplace_back(block, front.size);
      for (int i = 0; i < size; ++i) rows_.push_back(first[static_cast<std::size_t>(block)] + i);
      front.size += size;
    };
    for (const int block : step.own) {
      front_of_[static_cast<std::size_t>(block)] = static_cast<int>(fronts_.size());
      append(block);
    }
    front.own = front.size;
    for (const int block : step.rest) append(block);
    values += static_cast<std::size_t>(front.size) * static_cast<std::size_t>(front.size);
    rows += front.size;
    pivots += front.own;
    largest = std::max(largest, front.size);
    fronts_.push_back(front);
  }
  for (std::size_t f = 0; f < fronts_.size(); ++f) {
    Front& front = fronts_[f];
    front.first_run = front.last_run = static_cast<int>(runs_.size());
    if (front.own == front.size) continue;
    // The rest is a clique from here on, which the front of the first of them to go contains.
    front.parent = static_cast<int>(fronts_.size());
    for (const int block : order[f].rest)
      front.parent = std::min(front.parent, front_of_[static_cast<std::size_t>(block)]);
    const Front& parent = fronts_[static_cast<std::size_t>(front.parent)];
    const int* begin = rows_.data() + parent.first_row;
    for (int i = front.own; i < front.size; ++i) {
      const int at = static_cast<int>(
          std::find(begin, begin + parent.size, rows_[static_cast<std::size_t>(front.first_row + i)]) -
          begin);
      if (front.last_run > front.first_run && runs_.back().to + runs_.back().count == at) {
        ++runs_.back().count;
      } else {
        runs_.push_back({i, at, 1});
        ++front.last_run;
      }
    }
  }
  values_.assign(values, 0.0);
  FindFill(sizes, couplings);
  pivots_.assign(static_cast<std::size_t>(pivots), 0);
  scratch_.assign(static_cast<std::size_t>(largest), 0.0);
}

MultifrontalLu::Place MultifrontalLu::PlaceOf(int row, int column) const {
  const auto f = static_cast<std::size_t>(
      std::min(front_of_[static_cast<std::size_t>(row)], front_of_[static_cast<std::size_t>(column)]));
  const auto find = [&](int block) {
    const auto it =
        std::find_if(blocks_[f].begin(), blocks_[f].end(), [&](const auto& b) { return b.first == block; });
    FORK1S_REQUIRE(it != blocks_[f].end(), row, column);
    return static_cast<std::size_t>(it->second);
  };
  const Front& front = fronts_[f];
  return {front.begin + find(row) + find(column) * static_cast<std::size_t>(front.size), front.size};
}

void MultifrontalLu::FindFill(const std::vector<int>& sizes,
                              const std::vector<std::pair<int, int>>& couplings) {
  std::vector<char> is_fill(values_.size(), 1);
  for (const auto& [row, column] : couplings) {
    const Place place = PlaceOf(row, column);
    for (int k = 0; k < sizes[static_cast<std::size_t>(column)]; ++k)
      std::fill_n(is_fill.begin() + static_cast<std::ptrdiff_t>(place.begin) + k * place.stride,
                  sizes[static_cast<std::size_t>(row)], 0);
  }
  for (std::size_t i = 0; i < is_fill.size(); ++i) {
    if (!is_fill[i]) continue;
    if (i == 0 || !is_fill[i - 1]) fill_.emplace_back(i, 0);
    ++fill_.back().second;
  }
}

void MultifrontalLu::ClearFill() {
  for (const auto& [begin, count] : fill_) {
    double* to = values_.data() + begin;
    ByFours(count, [&](const auto& at) { at(to).setZero(); });
  }
}

void MultifrontalLu::AddToParent(const Front& front) {
  const Front& parent = fronts_[static_cast<std::size_t>(front.parent)];
  const Run *first = runs_.data() + front.first_run, *last = runs_.data() + front.last_run;
  for (const Run* columns = first; columns != last; ++columns)
    for (int k = 0; k < columns->count; ++k) {
      const double* from = values_.data() + front.begin + (columns->from + k) * front.size;
      double* to = values_.data() + parent.begin + (columns->to + k) * parent.size;
      for (const Run* run = first; run != last; ++run) {
        const double* from_rows = from + run->from;
        double* to_rows = to + run->to;
        ByFours(run->count, [&](const auto& at) { at(to_rows) += at(from_rows); });
      }
    }
}

bool MultifrontalLu::Factor() {
  for (const Front& front : fronts_) {
    if (!FactorLeadingLu(values_.data() + front.begin, front.size, front.own, kPivotThreshold,
                         pivots_.data() + front.first_pivot))
      return false;
    if (front.parent >= 0) AddToParent(front);
  }
  return true;
}

namespace {

// scratch <- rows of x, and back.
void Gather(const double* x, const int* rows, int count, double* scratch) {
  for (int i = 0; i < count; ++i) scratch[i] = x[rows[i]];
}
void Scatter(const double* scratch, const int* rows, int count, double* x) {
  for (int i = 0; i < count; ++i) x[rows[i]] = scratch[i];
}

// Rows of x, `stride` apart: row `to` less a[0] times row rows[0], a[next] times row rows[1] and so on, then times
// `scale`. Strips of kCount packets stay in registers.
template <class Some, int kCount>
void SubtractRows(const double* a, std::ptrdiff_t next, const int* rows, int count, std::ptrdiff_t stride,
                  double* x, int to, double scale) {
  constexpr int kSize = Some::RowsAtCompileTime;
  Some sum[kCount];
  double* const out = x + to * stride;
  for (int q = 0; q < kCount; ++q) sum[q] = Eigen::Map<const Some>(out + q * kSize);
  const auto subtract = [&](double factor, int from) {
    const double* row = x + from * stride;
    for (int q = 0; q < kCount; ++q) sum[q] -= factor * Eigen::Map<const Some>(row + q * kSize);
  };
  for (; count >= 3; count -= 3, a += 3 * next, rows += 3) {
    subtract(a[0], rows[0]);
    subtract(a[next], rows[1]);
    subtract(a[2 * next], rows[2]);
  }
  for (; count > 0; --count, a += next, ++rows) subtract(*a, *rows);
  for (int q = 0; q < kCount; ++q) Eigen::Map<Some>(out + q * kSize) = scale * sum[q];
}

}  // namespace

void MultifrontalLu::Solve(double* x) const {
  for (const Front& front : fronts_) {
    const int* rows = rows_.data() + front.first_row;
    Gather(x, rows, front.size, scratch_.data());
    SolveLeadingLower(values_.data() + front.begin, front.size, front.own, pivots_.data() + front.first_pivot,
                      scratch_.data());
    Scatter(scratch_.data(), rows, front.size, x);
  }
  for (std::size_t f = fronts_.size(); f-- > 0;) {
    const Front& front = fronts_[f];
    const int* rows = rows_.data() + front.first_row;
    Gather(x, rows, front.size, scratch_.data());
    SolveLeadingUpper(values_.data() + front.begin, front.size, front.own, scratch_.data());
    Scatter(scratch_.data(), rows, front.own, x);
  }
}

void MultifrontalLu::SolveTransposed(double* x) const {
  for (const Front& front : fronts_) {
    const int* rows = rows_.data() + front.first_row;
    Gather(x, rows, front.size, scratch_.data());
    SolveLeadingUpperTransposed(values_.data() + front.begin, front.size, front.own, scratch_.data());
    Scatter(scratch_.data(), rows, front.size, x);
  }
  for (std::size_t f = fronts_.size(); f-- > 0;) {
    const Front& front = fronts_[f];
    const int* rows = rows_.data() + front.first_row;
    Gather(x, rows, front.size, scratch_.data());
    SolveLeadingLowerTransposed(values_.data() + front.begin, front.size, front.own,
                                pivots_.data() + front.first_pivot, scratch_.data());
    Scatter(scratch_.data(), rows, front.own, x);
  }
}

template <class Some, int kCount>
void MultifrontalLu::SolveStrip(std::ptrdiff_t stride, double* x) const {
  for (const Front& front : fronts_) {
    const double* LU = values_.data() + front.begin;
    const int *rows = rows_.data() + front.first_row, *pivots = pivots_.data() + front.first_pivot;
    for (int k = 0; k < front.own; ++k)
      if (pivots[k] != k) {
        double* row = x + rows[k] * stride;
        std::swap_ranges(row, row + kCount * Some::RowsAtCompileTime, x + rows[pivots[k]] * stride);
      }
    for (int i = 1; i < front.size; ++i)
      SubtractRows<Some, kCount>(LU + i, front.size, rows, std::min(i, front.own), stride, x, rows[i], 1);
  }
  for (std::size_t f = fronts_.size(); f-- > 0;) {
    const Front& front = fronts_[f];
    const int* rows = rows_.data() + front.first_row;
    for (int i = front.own - 1; i >= 0; --i) {
      const double* diagonal =
          values_.data() + front.begin + static_cast<std::ptrdiff_t>(i) * (front.size + 1);
      SubtractRows<Some, kCount>(diagonal + front.size, front.size, rows + i + 1, front.size - i - 1, stride,
                                 x, rows[i], 1 / *diagonal);
    }
  }
}

void MultifrontalLu::SolveRows(int columns, double* x) const {
  using One = Eigen::Matrix<double, 1, 1>;
  int c = 0;
  for (; c + 24 <= columns; c += 24) SolveStrip<Quad, 6>(columns, x + c);
  switch ((columns - c) / 4) {
    case 5:
      SolveStrip<Quad, 5>(columns, x + c);
      break;
    case 4:
      SolveStrip<Quad, 4>(columns, x + c);
      break;
    case 3:
      SolveStrip<Quad, 3>(columns, x + c);
      break;
    case 2:
      SolveStrip<Quad, 2>(columns, x + c);
      break;
    case 1:
      SolveStrip<Quad, 1>(columns, x + c);
      break;
    default:
      break;
  }
  for (c = columns / 4 * 4; c < columns; ++c) SolveStrip<One, 1>(columns, x + c);
}

}  // namespace fork1s
