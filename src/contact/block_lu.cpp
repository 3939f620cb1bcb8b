// With a block A x + C y = a and its hub D x + B y = b,
//     (B − D A⁻¹ C) y = b − D A⁻¹ a,   x = A⁻¹ a − A⁻¹ C y.
// Blocks are small: rows of [A C] are reduced four columns at a time.
#include "block_lu.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/base/quad.hpp>
#include <fork1s/linalg/in_place.hpp>

namespace fork1s::internal {
namespace {

int WholeFours(int n) { return (n + 3) / 4 * 4; }

struct Rows {
  double* values;   // rows [A C] of `stride`, C from `width` on; both padded to whole fours
  double* L;        // f x f, by rows
  double* inverse;  // of pivots
  int f, width, stride;

  double* row(int i) const { return values + static_cast<std::ptrdiff_t>(i) * stride; }
};

// [A C] to [U A⁻¹C] and L, rows interchanged for the largest pivot. False where one vanishes. What stands
// left of a pivot afterwards means nothing.
bool Reduce(const Rows& rows, int* swaps) {
  const int f = rows.f;
  for (int k = 0; k < f; ++k) {
    int largest = k;
    for (int i = k + 1; i < f; ++i)
      if (std::abs(rows.row(i)[k]) > std::abs(rows.row(largest)[k])) largest = i;
    double* pivot = rows.row(k);
    swaps[k] = largest;
    if (largest != k) {
      std::swap_ranges(pivot, pivot + rows.stride, rows.row(largest));
      std::swap_ranges(rows.L + k * f, rows.L + k * f + k, rows.L + largest * f);
    }
    const double inverse = rows.inverse[k] = 1 / pivot[k];
    if (!std::isfinite(inverse)) return false;
    for (int i = k + 1; i < f; ++i) {
      double* row = rows.row(i);
      const double factor = rows.L[i * f + k] = row[k] * inverse;
      if (factor == 0) continue;
      for (int c = (k + 1) / 4 * 4; c < rows.stride; c += 4) QuadAt(row + c) -= factor * QuadAt(pivot + c);
    }
  }
  for (int k = f - 1; k >= 0; --k) {
    double* pivot = rows.row(k);
    for (int c = rows.width; c < rows.stride; c += 4) QuadAt(pivot + c) *= rows.inverse[k];
    for (int i = 0; i < k; ++i) {
      double* row = rows.row(i);
      const double factor = row[k];
      if (factor == 0) continue;
      for (int c = rows.width; c < rows.stride; c += 4) QuadAt(row + c) -= factor * QuadAt(pivot + c);
    }
  }
  return true;
}

// a <- A⁻¹ a
void SolveOwn(const Rows& rows, const int* swaps, double* a) {
  const int f = rows.f;
  for (int k = 0; k < f; ++k)
    if (swaps[k] != k) std::swap(a[k], a[swaps[k]]);
  for (int i = 1; i < f; ++i) {
    double sum = a[i];
    for (int k = 0; k < i; ++k) sum -= rows.L[i * f + k] * a[k];
    a[i] = sum;
  }
  for (int i = f - 1; i >= 0; --i) {
    double sum = a[i];
    for (int k = i + 1; k < f; ++k) sum -= rows.row(i)[k] * a[k];
    a[i] = sum * rows.inverse[i];
  }
}

void SolveOwnFour(const Rows& rows, const int* swaps, double* a) {
  const int f = rows.f;
  for (int k = 0; k < f; ++k)
    if (swaps[k] != k) std::swap_ranges(a + 4 * k, a + 4 * k + 4, a + 4 * swaps[k]);
  for (int i = 1; i < f; ++i) {
    Quad sum = QuadAt(a + 4 * i);
    for (int k = 0; k < i; ++k) sum -= rows.L[i * f + k] * QuadAt(a + 4 * k);
    QuadAt(a + 4 * i) = sum;
  }
  for (int i = f - 1; i >= 0; --i) {
    Quad sum = QuadAt(a + 4 * i);
    for (int k = i + 1; k < f; ++k) sum -= rows.row(i)[k] * QuadAt(a + 4 * k);
    QuadAt(a + 4 * i) = sum * rows.inverse[i];
  }
}

}  // namespace

void BlockLu::Reserve(int freedoms) {
  const auto n = static_cast<std::size_t>(freedoms);
  for (std::vector<double>* v : {&x_hub_, &x_core_}) v->reserve(4 * n);
  for (std::vector<int>* v : {&pivots_, &swaps_}) v->reserve(n);
  parts_.reserve(n);
  values_.reserve(6 * n * n + 64 * n);
}

bool BlockLu::Factor(const EliminationOrder& order, double* H, int n) {
  parts_.clear();
  std::size_t at = 0, swaps = 0;
  for (const EliminationOrder::Block& block : order.blocks()) {
    const int f = block.own.size(), width = WholeFours(f), stride = width + WholeFours(block.hub_size);
    parts_.push_back({width, stride, at, swaps});
    at += static_cast<std::size_t>(f * (stride + f + 1 + block.hub_size));
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

bool BlockLu::Eliminate(const EliminationOrder& order, std::size_t b, double* H, int n) {
  const EliminationOrder::Block& block = order.blocks()[b];
  const Part& part = parts_[b];
  const Span *hubs = order.hubs().data() + block.first_hub, *hubs_end = hubs + block.num_hubs;
  const int f = block.own.size(), m = block.hub_size, stride = part.stride;
  double* values = values_.data() + part.at;
  const Rows rows{values, values + f * stride, values + f * (stride + f), f, part.width, stride};
  double* D = rows.inverse + f;
  const auto column = [&](int c) { return H + static_cast<std::ptrdiff_t>(c) * n; };
  ByFours(f * stride, [&](const auto& at) { at(values).setZero(); });
  double* to = D;
  for (int c = 0; c < f; ++c) {
    const double* from = column(block.own.begin + c);
    for (int r = 0; r < f; ++r) values[r * stride + c] = from[block.own.begin + r];
    for (const Span* hub = hubs; hub != hubs_end; ++hub)
      for (int i = hub->begin; i < hub->end; ++i) *to++ = from[i];
  }
  double* C = values + part.width;
  for (const Span* hub = hubs; hub != hubs_end; ++hub)
    for (int c = hub->begin; c < hub->end; ++c, ++C) {
      const double* from = column(c) + block.own.begin;
      for (int r = 0; r < f; ++r) C[r * stride] = from[r];
    }
  if (!Reduce(rows, swaps_.data() + part.swaps)) return false;
  C = values + part.width;
  for (const Span* hub = hubs; hub != hubs_end; ++hub)
    for (int c = hub->begin; c < hub->end; ++c, ++C) {
      const double* left = D;
      for (const Span* span = hubs; span != hubs_end; left += span->size(), ++span) {
        double* B = column(c) + span->begin;
        ByFours(span->size(), [&](const auto& four) {
          typename decltype(four(B))::PlainObject sum = four(B);
          for (int k = 0; k < f; ++k) sum -= C[k * stride] * four(left + k * m);
          four(B) = sum;
        });
      }
    }
  return true;
}

void BlockLu::Solve(const EliminationOrder& order, double* x) {
  for (std::size_t b = 0; b < parts_.size(); ++b) {
    const EliminationOrder::Block& block = order.blocks()[b];
    const Part& part = parts_[b];
    const int f = block.own.size(), m = block.hub_size;
    double *values = values_.data() + part.at, *a = x + block.own.begin;
    const Rows rows{values,     values + f * part.stride, values + f * (part.stride + f), f, part.width,
                    part.stride};
    const double* D = rows.inverse + f;
    SolveOwn(rows, swaps_.data() + part.swaps, a);
    const Span* hubs = order.hubs().data() + block.first_hub;
    for (const Span* hub = hubs; hub != hubs + block.num_hubs; D += hub->size(), ++hub) {
      double* y = x + hub->begin;
      ByFours(hub->size(), [&](const auto& four) {
        typename decltype(four(y))::PlainObject sum = four(y);
        for (int k = 0; k < f; ++k) sum -= a[k] * four(D + k * m);
        four(y) = sum;
      });
    }
  }
  double* to = x_core_.data();
  for (const Span& span : order.core()) to = std::copy(x + span.begin, x + span.end, to);
  SolveWithLu(values_.data() + core_at_, order.core_size(), pivots_.data(), x_core_.data());
  const double* from = x_core_.data();
  for (const Span& span : order.core())
    for (int i = span.begin; i < span.end; ++i) x[i] = *from++;
  for (std::size_t b = parts_.size(); b-- > 0;) {
    const EliminationOrder::Block& block = order.blocks()[b];
    const Span* hubs = order.hubs().data() + block.first_hub;
    x_hub_.clear();
    for (const Span* hub = hubs; hub != hubs + block.num_hubs; ++hub)
      for (int i = hub->begin; i < hub->end; ++i) x_hub_.push_back(x[i]);
    while (x_hub_.size() % 4 != 0) x_hub_.push_back(0);
    for (int r = 0; r < block.own.size(); ++r) {
      const double* X = values_.data() + parts_[b].at + r * parts_[b].stride + parts_[b].width;
      Quad sums = Quad::Zero();
      for (std::size_t c = 0; c < x_hub_.size(); c += 4)
        sums += QuadAt(X + c).cwiseProduct(QuadAt(x_hub_.data() + c));
      x[block.own.begin + r] -= sums.sum();
    }
  }
}

void BlockLu::SolveFour(const EliminationOrder& order, double* x) {
  const auto rows_of = [&](const EliminationOrder::Block& block, const Part& part) {
    const int f = block.own.size();
    double* values = values_.data() + part.at;
    return Rows{values, values + f * part.stride, values + f * (part.stride + f), f, part.width, part.stride};
  };
  for (std::size_t b = 0; b < parts_.size(); ++b) {
    const EliminationOrder::Block& block = order.blocks()[b];
    const Rows rows = rows_of(block, parts_[b]);
    const int f = rows.f, m = block.hub_size;
    double* a = x + 4 * block.own.begin;
    // Right sides are of single points, which few blocks hear.
    if (std::all_of(a, a + 4 * f, [](double v) { return v == 0; })) continue;
    SolveOwnFour(rows, swaps_.data() + parts_[b].swaps, a);
    const double* D = rows.inverse + f;
    const Span* hubs = order.hubs().data() + block.first_hub;
    for (const Span* hub = hubs; hub != hubs + block.num_hubs; ++hub)
      for (int i = hub->begin; i < hub->end; ++i, ++D) {
        Quad sum = QuadAt(x + 4 * i);
        for (int k = 0; k < f; ++k) sum -= D[k * m] * QuadAt(a + 4 * k);
        QuadAt(x + 4 * i) = sum;
      }
  }
  double* to = x_core_.data();
  for (const Span& span : order.core()) to = std::copy(x + 4 * span.begin, x + 4 * span.end, to);
  SolveRowsWithLu(values_.data() + core_at_, order.core_size(), pivots_.data(), 4, x_core_.data());
  const double* from = x_core_.data();
  for (const Span& span : order.core())
    for (int i = 4 * span.begin; i < 4 * span.end; ++i) x[i] = *from++;
  for (std::size_t b = parts_.size(); b-- > 0;) {
    const EliminationOrder::Block& block = order.blocks()[b];
    const Rows rows = rows_of(block, parts_[b]);
    const Span* hubs = order.hubs().data() + block.first_hub;
    for (int r = 0; r < rows.f; ++r) {
      const double* X = rows.row(r) + rows.width;
      double* a = x + 4 * (block.own.begin + r);
      Quad sum = QuadAt(a);
      for (const Span* hub = hubs; hub != hubs + block.num_hubs; ++hub)
        for (int i = hub->begin; i < hub->end; ++i) sum -= *X++ * QuadAt(x + 4 * i);
      QuadAt(a) = sum;
    }
  }
}

}  // namespace fork1s::internal
