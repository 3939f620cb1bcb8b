// With leaf A x + C y = a and hub D x + B y = b,
//     (B − D A⁻¹ C) y = b − D A⁻¹ a,   x = A⁻¹ a − A⁻¹ C y.
// Leaves are small: rows of [A C 1] are reduced four columns at a time to [1 A⁻¹C A⁻¹].
#include "leaf_lu.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/base/quad.hpp>
#include <fork1s/linalg/in_place.hpp>

namespace fork1s::internal {
namespace {

int WholeFours(int n) { return (n + 3) / 4 * 4; }

// Gauss and Jordan's, rows interchanged for the largest pivot. False where one vanishes.
bool ReduceRows(double* rows, int count, int stride) {
  for (int k = 0; k < count; ++k) {
    int largest = k;
    for (int i = k + 1; i < count; ++i)
      if (std::abs(rows[i * stride + k]) > std::abs(rows[largest * stride + k])) largest = i;
    double* pivot = rows + k * stride;
    if (largest != k) std::swap_ranges(pivot, pivot + stride, rows + largest * stride);
    const double inverse = 1 / pivot[k];
    if (!std::isfinite(inverse)) return false;
    const int from = k / 4 * 4;  // before it all is reduced
    for (int c = from; c < stride; c += 4) QuadAt(pivot + c) *= inverse;
    for (int i = 0; i < count; ++i) {
      if (i == k) continue;
      double* row = rows + i * stride;
      const double factor = row[k];
      if (factor == 0) continue;
      for (int c = from; c < stride; c += 4) QuadAt(row + c) -= factor * QuadAt(pivot + c);
    }
  }
  return true;
}

}  // namespace

void LeafLu::Reserve(int freedoms) {
  const auto n = static_cast<std::size_t>(freedoms);
  parts_.reserve(n);
  core_.reserve(n);
  pivots_.reserve(n);
  values_.reserve(6 * n * n + 64 * n);
  x_leaf_.reserve(n);
  x_core_.reserve(n);
}

bool LeafLu::Factor(const std::vector<Leaf>& leaves, const std::vector<int>& core, double* H, int n) {
  parts_.clear();
  core_ = core;
  std::size_t at = 0;
  for (const Leaf& leaf : leaves) {
    const int stride = WholeFours(2 * leaf.count + leaf.hub_count);
    parts_.push_back({leaf, stride, at});
    at += static_cast<std::size_t>(leaf.count * stride + leaf.count * leaf.hub_count);
  }
  core_at_ = at;
  values_.resize(at + core.size() * core.size());
  pivots_.resize(core.size());
  x_core_.resize(core.size());
  const auto column = [&](int c) { return H + static_cast<std::ptrdiff_t>(c) * n; };
  for (const Part& part : parts_) {
    const Leaf& leaf = part.leaf;
    const int f = leaf.count, m = leaf.hub_count, stride = part.stride;
    double *rows = values_.data() + part.at, *D = rows + f * stride;
    std::fill_n(rows, f * stride, 0.0);
    for (int c = 0; c < f; ++c) {
      const double* from = column(leaf.begin + c);
      for (int r = 0; r < f; ++r) rows[r * stride + c] = from[leaf.begin + r];
      rows[c * stride + f + m + c] = 1;
      std::copy_n(from + leaf.hub_begin, m, D + c * m);
    }
    for (int c = 0; c < m; ++c) {
      const double* from = column(leaf.hub_begin + c) + leaf.begin;
      for (int r = 0; r < f; ++r) rows[r * stride + f + c] = from[r];
    }
    if (!ReduceRows(rows, f, stride)) return false;
    for (int c = 0; c < m; ++c) {
      double* B = column(leaf.hub_begin + c) + leaf.hub_begin;
      for (int k = 0; k < f; ++k) {
        const double x = rows[k * stride + f + c];
        ByFours(m, [&](const auto& four) { four(B) -= x * four(D + k * m); });
      }
    }
  }
  double* core_values = values_.data() + core_at_;
  const auto size = static_cast<int>(core.size());
  for (int c = 0; c < size; ++c) {
    const double* from = column(core[static_cast<std::size_t>(c)]);
    for (int r = 0; r < size; ++r) core_values[c * size + r] = from[core[static_cast<std::size_t>(r)]];
  }
  return FactorLu(core_values, size, pivots_.data());
}

void LeafLu::Solve(double* x) {
  for (const Part& part : parts_) {
    const Leaf& leaf = part.leaf;
    const int f = leaf.count, m = leaf.hub_count;
    const double *rows = values_.data() + part.at, *D = rows + f * part.stride;
    double *a = x + leaf.begin, *b = x + leaf.hub_begin;
    x_leaf_.assign(a, a + f);
    for (int r = 0; r < f; ++r) {
      const double* inverse = rows + r * part.stride + f + m;
      double sum = 0;
      for (int k = 0; k < f; ++k) sum += inverse[k] * x_leaf_[static_cast<std::size_t>(k)];
      a[r] = sum;
    }
    for (int k = 0; k < f; ++k) ByFours(m, [&](const auto& four) { four(b) -= a[k] * four(D + k * m); });
  }
  const auto size = static_cast<int>(core_.size());
  for (int i = 0; i < size; ++i) x_core_[static_cast<std::size_t>(i)] = x[core_[static_cast<std::size_t>(i)]];
  SolveWithLu(values_.data() + core_at_, size, pivots_.data(), x_core_.data());
  for (int i = 0; i < size; ++i) x[core_[static_cast<std::size_t>(i)]] = x_core_[static_cast<std::size_t>(i)];
  for (const Part& part : parts_) {
    const Leaf& leaf = part.leaf;
    const double *rows = values_.data() + part.at, *y = x + leaf.hub_begin;
    for (int r = 0; r < leaf.count; ++r) {
      const double* X = rows + r * part.stride + leaf.count;
      double sum = 0;
      for (int c = 0; c < leaf.hub_count; ++c) sum += X[c] * y[c];
      x[leaf.begin + r] -= sum;
    }
  }
}

}  // namespace fork1s::internal
