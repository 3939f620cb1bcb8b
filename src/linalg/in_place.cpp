#include <fork1s/base/quad.hpp>
#include <fork1s/linalg/in_place.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace fork1s {
namespace {

void Subtract(double factor, const double* x, int n, double* y) {
  ByFours(n, [&](const auto& at) { at(y) -= factor * at(x); });
}

// kColumns right sides next to each other, rows swapped already.
template <int kColumns>
void SolveColumnsWithLu(const double* LU, int n, std::ptrdiff_t stride, double* x) {
  using Columns = Eigen::Matrix<double, kColumns, 1>;
  const auto at = [](double* p) { return Eigen::Map<Columns>(p); };
  for (int k = 0; k < n; ++k) {
    const double* ak = LU + static_cast<std::ptrdiff_t>(k) * n;
    const Columns value = at(x + k * stride);
    for (int i = k + 1; i < n; ++i) at(x + i * stride) -= ak[i] * value;
  }
  for (int k = n - 1; k >= 0; --k) {
    const double* ak = LU + static_cast<std::ptrdiff_t>(k) * n;
    const Columns value = at(x + k * stride) * (1 / ak[k]);
    at(x + k * stride) = value;
    for (int i = 0; i < k; ++i) at(x + i * stride) -= ak[i] * value;
  }
}

// Four columns of length `stride` apart, less `factors` times x: x is read once for the four.
void SubtractFromFour(const double* x, int n, const double* factors, int stride, double* c0) {
  double *c1 = c0 + stride, *c2 = c1 + stride, *c3 = c2 + stride;
  const double f0 = factors[0], f1 = factors[1], f2 = factors[2], f3 = factors[3];
  if (f0 == 0 && f1 == 0 && f2 == 0 && f3 == 0) return;
  ByFours(n, [&](const auto& at) {
    const typename decltype(at(x))::PlainObject some = at(x);
    at(c0) -= f0 * some;
    at(c1) -= f1 * some;
    at(c2) -= f2 * some;
    at(c3) -= f3 * some;
  });
}

double* Column(double* A, int n, int k) { return A + static_cast<std::ptrdiff_t>(k) * n; }

}  // namespace

bool FactorLu(double* A, int n, int* pivots) {
  for (int k = 0; k < n; ++k) {
    double* ak = Column(A, n, k);
    int pivot = k;
    double largest = std::abs(ak[k]);
    for (int i = k + 1; i < n; ++i)
      if (std::abs(ak[i]) > largest) {
        largest = std::abs(ak[i]);
        pivot = i;
      }
    if (!(largest > 1e-300)) return false;
    pivots[k] = pivot;
    if (pivot != k)
      for (int j = 0; j < n; ++j) std::swap(Column(A, n, j)[k], Column(A, n, j)[pivot]);
    const int rest = n - k - 1;
    double* lower = ak + k + 1;
    const double inverse = 1 / ak[k];
    ByFours(rest, [&](const auto& at) { at(lower) *= inverse; });
    int j = k + 1;
    for (; j + 4 <= n; j += 4) {
      double* c = Column(A, n, j);
      const double factors[] = {c[k], Column(c, n, 1)[k], Column(c, n, 2)[k], Column(c, n, 3)[k]};
      SubtractFromFour(lower, rest, factors, n, c + k + 1);
    }
    for (; j < n; ++j) Subtract(Column(A, n, j)[k], lower, rest, Column(A, n, j) + k + 1);
  }
  return true;
}

void SolveWithLu(const double* LU, int n, const int* pivots, double* x) {
  for (int k = 0; k < n; ++k)
    if (pivots[k] != k) std::swap(x[k], x[pivots[k]]);
  for (int k = 0; k < n; ++k) {
    const double* ak = LU + static_cast<std::ptrdiff_t>(k) * n;
    Subtract(x[k], ak + k + 1, n - k - 1, x + k + 1);
  }
  for (int k = n - 1; k >= 0; --k) {
    const double* ak = LU + static_cast<std::ptrdiff_t>(k) * n;
    x[k] /= ak[k];
    Subtract(x[k], ak, k, x);
  }
}

void SolveRowsWithLu(const double* LU, int n, const int* pivots, int columns, double* x) {
  const auto row = [&](int i) { return x + static_cast<std::ptrdiff_t>(i) * columns; };
  for (int k = 0; k < n; ++k)
    if (pivots[k] != k) std::swap_ranges(row(k), row(k) + columns, row(pivots[k]));
  int c = 0;
  for (; c + 8 <= columns; c += 8) SolveColumnsWithLu<8>(LU, n, columns, x + c);
  for (; c + 4 <= columns; c += 4) SolveColumnsWithLu<4>(LU, n, columns, x + c);
  for (; c < columns; ++c) SolveColumnsWithLu<1>(LU, n, columns, x + c);
}

void SolveTransposedWithLu(const double* LU, int n, const int* pivots, double* x) {
  for (int k = 0; k < n; ++k) {
    const double* ak = LU + static_cast<std::ptrdiff_t>(k) * n;
    double sum = x[k];
    for (int i = 0; i < k; ++i) sum -= ak[i] * x[i];
    x[k] = sum / ak[k];
  }
  for (int k = n - 1; k >= 0; --k) {
    const double* ak = LU + static_cast<std::ptrdiff_t>(k) * n;
    double sum = x[k];
    for (int i = k + 1; i < n; ++i) sum -= ak[i] * x[i];
    x[k] = sum;
  }
  for (int k = n - 1; k >= 0; --k)
    if (pivots[k] != k) std::swap(x[k], x[pivots[k]]);
}

void SolveLower(const double* L, int n, int stride, double* Y, int columns, int Y_stride) {
  int c = 0;
  for (; c + 4 <= columns; c += 4) {
    double* y0 = Y + static_cast<std::ptrdiff_t>(c) * Y_stride;
    double *y1 = y0 + Y_stride, *y2 = y1 + Y_stride, *y3 = y2 + Y_stride;
    for (int k = 0; k < n; ++k) {
      if (y0[k] == 0 && y1[k] == 0 && y2[k] == 0 && y3[k] == 0) continue;
      const double* l = L + static_cast<std::ptrdiff_t>(k) * stride;
      const double inverse = 1 / l[k];
      const double v0 = y0[k] *= inverse, v1 = y1[k] *= inverse, v2 = y2[k] *= inverse, v3 = y3[k] *= inverse;
      const double* below = l + k + 1;
      ByFours(n - k - 1, [&](const auto& at) {
        const typename decltype(at(below))::PlainObject some = at(below);
        at(y0 + k + 1) -= v0 * some;
        at(y1 + k + 1) -= v1 * some;
        at(y2 + k + 1) -= v2 * some;
        at(y3 + k + 1) -= v3 * some;
      });
    }
  }
  for (; c < columns; ++c) {
    double* y = Y + static_cast<std::ptrdiff_t>(c) * Y_stride;
    for (int k = 0; k < n; ++k) {
      if (y[k] == 0) continue;
      const double* l = L + static_cast<std::ptrdiff_t>(k) * stride;
      y[k] *= 1 / l[k];
      Subtract(y[k], l + k + 1, n - k - 1, y + k + 1);
    }
  }
}

bool SolveByCholesky(double* A, int n, double* x) {
  for (int k = 0; k < n; ++k) {
    double* ak = Column(A, n, k);
    if (!(ak[k] > 0) || !std::isfinite(ak[k])) return false;
    const double root = std::sqrt(ak[k]), inverse = 1 / root;
    ak[k] = root;
    for (int i = k + 1; i < n; ++i) ak[i] *= inverse;
    int j = k + 1;
    for (; j + 4 <= n; j += 4)  // above the diagonal nobody reads
      SubtractFromFour(ak + j, n - j, ak + j, n, Column(A, n, j) + j);
    for (; j < n; ++j)
      if (ak[j] != 0) Subtract(ak[j], ak + j, n - j, Column(A, n, j) + j);
    x[k] *= inverse;
    Subtract(x[k], ak + k + 1, n - k - 1, x + k + 1);
  }
  for (int k = n - 1; k >= 0; --k) {
    const double* ak = Column(A, n, k);
    double sum = x[k];
    for (int i = k + 1; i < n; ++i) sum -= ak[i] * x[i];
    x[k] = sum / ak[k];
  }
  return true;
}

void TriangularRoot(double* A, int rows, int columns) {
  for (int k = 0; k < columns; ++k) {
    double* v = Column(A, rows, k);
    double norm2 = 0;
    for (int i = k; i < rows; ++i) norm2 += v[i] * v[i];
    if (!(norm2 > 0)) continue;
    const double end = v[k] > 0 ? -std::sqrt(norm2) : std::sqrt(norm2), head = v[k] - end;
    // The reflection 1 − 2 v vᵀ/vᵀv with v = (head, rest) takes the column to (end, 0).
    const double length2 = norm2 - v[k] * v[k] + head * head;
    if (length2 > 0)
      for (int j = k + 1; j < columns; ++j) {
        double* a = Column(A, rows, j);
        double dot = head * a[k];
        for (int i = k + 1; i < rows; ++i) dot += v[i] * a[i];
        const double factor = 2 * dot / length2;
        a[k] -= factor * head;
        Subtract(factor, v + k + 1, rows - k - 1, a + k + 1);
      }
    v[k] = end;
    for (int i = k + 1; i < rows; ++i) v[i] = 0;
  }
}

}  // namespace fork1s
