// Of a block A x + C y = a and its hub D x + B y = b, with P A = L U,
//     D' = D U⁻¹,   C' = L⁻¹ P C,   a' = L⁻¹ P a,   (B − D' C') y = b − D' a',   x = U⁻¹ (a' − C' y).
// [A; D] is factored as one panel, by columns.
#include "block_lu.hpp"
#include "linalg/in_place.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/base/quad.hpp>
#include <type_traits>

namespace fork1s::internal {
namespace {

// act(f), for a finger's or a body's freedoms with f known as it is compiled: loops over so few cost more than
// what they do.
template <class Act>
auto WithSize(int f, const Act& act) {
  switch (f) {
    case 1:
      return act(std::integral_constant<int, 1>());
    case 2:
      return act(std::integral_constant<int, 2>());
    case 3:
      return act(std::integral_constant<int, 3>());
    case 4:
      return act(std::integral_constant<int, 4>());
    case 5:
      return act(std::integral_constant<int, 5>());
    case 6:
      return act(std::integral_constant<int, 6>());
    default:
      return act(f);
  }
}

// y −= factors[0] X_0 + factors[1] X_1 + ..., columns of X `stride` apart.
template <class Size>
inline void SubtractColumns(const double* X, std::ptrdiff_t stride, Size columns, const double* factors,
                            int n, double* y) {
  ByFours(n, [&](const auto& at) {
    typename decltype(at(y))::PlainObject sum = at(y);
    const double* x = X;
    for (int k = 0; k < columns; ++k, x += stride) sum -= factors[k] * at(x);
    at(y) = sum;
  });
}

void Swap(const int* swaps, int f, double* a) {
  for (int k = 0; k < f; ++k)
    if (swaps[k] != k) std::swap(a[k], a[swaps[k]]);
}

}  // namespace

// [A; D] to L, U and D', rows interchanged for the largest pivot of A. False where one vanishes.
template <class Size>
bool BlockLu::FactorPanel(const Panel& panel, Size f, int* swaps) {
  for (int k = 0; k < f; ++k) {
    double* pivot = panel.column(k);
    int largest = k;
    for (int i = k + 1; i < f; ++i)
      if (std::abs(pivot[i]) > std::abs(pivot[largest])) largest = i;
    swaps[k] = largest;
    if (largest != k)
      for (int j = 0; j < f; ++j) std::swap(panel.column(j)[k], panel.column(j)[largest]);
    const double inverse = panel.inverse[k] = 1 / pivot[k];
    if (!std::isfinite(inverse)) return false;
    double* below = pivot + k + 1;
    const int rest = panel.rows - k - 1;
    ByFours(rest, [&](const auto& at) {
      const typename decltype(at(below))::PlainObject some = inverse * at(below);
      at(below) = some;
      double* other = below;
      for (int j = k + 1; j < f; ++j) {
        other += panel.rows;
        at(other) -= other[-1] * some;
      }
    });
  }
  return true;
}

// a <- L⁻¹ a
template <class Size>
void BlockLu::Forward(const Panel& panel, Size f, double* a) {
  for (int k = 0; k + 1 < f; ++k)
    for (int i = k + 1; i < f; ++i) a[i] -= panel.column(k)[i] * a[k];
}

// a <- U⁻¹ a
template <class Size>
void BlockLu::Backward(const Panel& panel, Size f, double* a) {
  for (int k = f - 1; k >= 0; --k) {
    a[k] *= panel.inverse[k];
    for (int i = 0; i < k; ++i) a[i] -= panel.column(k)[i] * a[k];
  }
}

void BlockLu::Reserve(int freedoms) {
  const auto n = static_cast<std::size_t>(freedoms);
  x_core_.reserve(4 * n);
  for (std::vector<int>* v : {&pivots_, &swaps_}) v->reserve(n);
  parts_.reserve(n);
  values_.reserve(6 * n * n + 64 * n);
}

bool BlockLu::Factor(const EliminationOrder& order, double* H, int n) {
  parts_.clear();
  std::size_t at = 0, swaps = 0;
  for (const EliminationOrder::Block& block : order.blocks()) {
    const int f = block.own.size();
    parts_.push_back({f, f + block.hub_size, at, swaps});
    at += static_cast<std::size_t>(f * (f + 2 * block.hub_size + 1));
    swaps += static_cast<std::size_t>(f);
  }
  const int size = order.core_size();
  core_at_ = at;
  values_.resize(at + static_cast<std::size_t>(size * size));
  swaps_.resize(swaps);
  pivots_.resize(static_cast<std::size_t>(size));
  x_core_.resize(static_cast<std::size_t>(4 * size));
  for (std::size_t b = 0; b < parts_.size(); ++b)
    if (!Eliminate(order, b, H, n)) return false;
  double* to = values_.data() + core_at_;
  for (const Span& columns : order.core())
    for (int c = columns.begin; c < columns.end; ++c)
      for (const Span& rows : order.core()) {
        const double* column = H + static_cast<std::ptrdiff_t>(c) * n;
        to = std::copy(column + rows.begin, column + rows.end, to);
      }
  return FactorLu(values_.data() + core_at_, size, pivots_.data());
}

BlockLu::Panel BlockLu::PanelOf(const Part& part) {
  double* values = values_.data() + part.at;
  double* C = values + part.f * part.rows;
  return {values, C, C + part.f * (part.rows - part.f), part.f, part.rows};
}

bool BlockLu::Eliminate(const EliminationOrder& order, std::size_t b, double* H, int n) {
  const EliminationOrder::Block& block = order.blocks()[b];
  const Panel panel = PanelOf(parts_[b]);
  int* swaps = swaps_.data() + parts_[b].swaps;
  const Span *hubs = order.hubs().data() + block.first_hub, *hubs_end = hubs + block.num_hubs;
  const auto column = [&](int c) { return H + static_cast<std::ptrdiff_t>(c) * n; };
  const auto copy = [](const double* from, int count, double* to) {
    ByFours(count, [&](const auto& at) { at(to) = at(from); });
  };
  return WithSize(panel.f, [&](const auto f) {
    for (int k = 0; k < f; ++k) {
      const double* from = column(block.own.begin + k);
      double* to = panel.column(k);
      copy(from + block.own.begin, f, to);
      to += f;
      for (const Span* hub = hubs; hub != hubs_end; to += hub->size(), ++hub)
        copy(from + hub->begin, hub->size(), to);
    }
    if (!FactorPanel(panel, f, swaps)) return false;
    double* C = panel.C;
    for (const Span* hub = hubs; hub != hubs_end; ++hub)
      for (int c = hub->begin; c < hub->end; ++c, C += f) {
        copy(column(c) + block.own.begin, f, C);
        Swap(swaps, f, C);
        Forward(panel, f, C);
        const double* left = panel.column(0) + f;
        for (const Span* span = hubs; span != hubs_end; left += span->size(), ++span)
          SubtractColumns(left, panel.rows, f, C, span->size(), column(c) + span->begin);
      }
    return true;
  });
}

void BlockLu::Solve(const EliminationOrder& order, double* x) {
  for (std::size_t b = 0; b < parts_.size(); ++b) {
    const EliminationOrder::Block& block = order.blocks()[b];
    const Panel panel = PanelOf(parts_[b]);
    double* a = x + block.own.begin;
    const Span* hubs = order.hubs().data() + block.first_hub;
    WithSize(panel.f, [&](const auto f) {
      Swap(swaps_.data() + parts_[b].swaps, f, a);
      Forward(panel, f, a);
      const double* D = panel.column(0) + f;
      for (const Span* hub = hubs; hub != hubs + block.num_hubs; D += hub->size(), ++hub)
        SubtractColumns(D, panel.rows, f, a, hub->size(), x + hub->begin);
    });
  }
  double* to = x_core_.data();
  for (const Span& span : order.core()) to = std::copy(x + span.begin, x + span.end, to);
  SolveWithLu(values_.data() + core_at_, order.core_size(), pivots_.data(), x_core_.data());
  const double* from = x_core_.data();
  for (const Span& span : order.core())
    for (int i = span.begin; i < span.end; ++i) x[i] = *from++;
  for (std::size_t b = parts_.size(); b-- > 0;) {
    const EliminationOrder::Block& block = order.blocks()[b];
    const Panel panel = PanelOf(parts_[b]);
    double* a = x + block.own.begin;
    const Span* hubs = order.hubs().data() + block.first_hub;
    WithSize(panel.f, [&](const auto f) {
      const double* C = panel.C;
      for (const Span* hub = hubs; hub != hubs + block.num_hubs; C += hub->size() * f, ++hub)
        SubtractColumns(C, f, hub->size(), x + hub->begin, f, a);
      Backward(panel, f, a);
    });
  }
}

void BlockLu::SolveFour(const EliminationOrder& order, double* x) {
  for (std::size_t b = 0; b < parts_.size(); ++b) {
    const EliminationOrder::Block& block = order.blocks()[b];
    const Panel panel = PanelOf(parts_[b]);
    const int f = panel.f;
    const int* swaps = swaps_.data() + parts_[b].swaps;
    double* a = x + 4 * block.own.begin;
    // Right sides are of single points, which few blocks depend on.
    if (std::all_of(a, a + 4 * f, [](double v) { return v == 0; })) continue;
    for (int k = 0; k < f; ++k)
      if (swaps[k] != k) std::swap_ranges(a + 4 * k, a + 4 * k + 4, a + 4 * swaps[k]);
    const auto subtract = [&](int row, int columns, double* from) {
      const double* L = panel.column(0) + row;
      Quad sum = QuadAt(from);
      for (int k = 0; k < columns; ++k, L += panel.rows) sum -= *L * QuadAt(a + 4 * k);
      QuadAt(from) = sum;
    };
    for (int i = 1; i < f; ++i) subtract(i, i, a + 4 * i);
    int row = f;
    const Span* hubs = order.hubs().data() + block.first_hub;
    for (const Span* hub = hubs; hub != hubs + block.num_hubs; ++hub)
      for (int i = hub->begin; i < hub->end; ++i) subtract(row++, f, x + 4 * i);
  }
  double* to = x_core_.data();
  for (const Span& span : order.core()) to = std::copy(x + 4 * span.begin, x + 4 * span.end, to);
  SolveRowsWithLu(values_.data() + core_at_, order.core_size(), pivots_.data(), 4, x_core_.data());
  const double* from = x_core_.data();
  for (const Span& span : order.core())
    for (int i = 4 * span.begin; i < 4 * span.end; ++i) x[i] = *from++;
  for (std::size_t b = parts_.size(); b-- > 0;) {
    const EliminationOrder::Block& block = order.blocks()[b];
    const Panel panel = PanelOf(parts_[b]);
    const Span* hubs = order.hubs().data() + block.first_hub;
    double* a = x + 4 * block.own.begin;
    for (int r = panel.f - 1; r >= 0; --r) {
      Quad sum = QuadAt(a + 4 * r);
      const double* C = panel.C + r;
      for (const Span* hub = hubs; hub != hubs + block.num_hubs; ++hub)
        for (int i = hub->begin; i < hub->end; ++i, C += panel.f) sum -= *C * QuadAt(x + 4 * i);
      for (int k = r + 1; k < panel.f; ++k) sum -= panel.column(k)[r] * QuadAt(a + 4 * k);
      QuadAt(a + 4 * r) = panel.inverse[r] * sum;
    }
  }
}

}  // namespace fork1s::internal
