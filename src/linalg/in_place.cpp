#include <fork1s/base/quad.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "linalg/in_place.hpp"

namespace fork1s {
namespace {

void Subtract(double factor, const double* x, int n, double* y) {
  ByFours(n, [&](const auto& at) { at(y) -= factor * at(x); });
}

// Rows of 4 kQuads right sides, `stride` apart, swapped already: row i less the multiples of others that
// stand in row i of LU, from `first` to `last` in steps of `step`, 1 or -1. The row stays in registers
// meanwhile; four multiples that are 0 are passed over, as where a loop does not depend on another.
template <int kQuads>
void SubtractRows(const double* LU, std::ptrdiff_t n, int i, int first, int last, int step,
                  std::ptrdiff_t stride, double* x) {
  Quad own[kQuads];
  for (int q = 0; q < kQuads; ++q) own[q] = QuadAt(x + i * stride + 4 * q);
  const auto subtract = [&](double factor, const double* row) {
    for (int q = 0; q < kQuads; ++q) own[q] -= factor * QuadAt(row + 4 * q);
  };
  const std::ptrdiff_t next = step * n, next_row = step * stride;
  const double *a = LU + first * n + i, *row = x + first * stride;
  int left = (last - first) * step;
  for (; left >= 4; left -= 4, a += 4 * next, row += 4 * next_row) {
    const double a0 = a[0], a1 = a[next], a2 = a[2 * next], a3 = a[3 * next];
    if (a0 == 0 && a1 == 0 && a2 == 0 && a3 == 0) continue;
    subtract(a0, row);
    subtract(a1, row + next_row);
    subtract(a2, row + 2 * next_row);
    subtract(a3, row + 3 * next_row);
  }
  for (; left > 0; --left, a += next, row += next_row) subtract(*a, row);
  for (int q = 0; q < kQuads; ++q) QuadAt(x + i * stride + 4 * q) = own[q];
}

template <int kQuads>
void SolveQuadsWithLu(const double* LU, int n, std::ptrdiff_t stride, double* x) {
  for (int i = 1; i < n; ++i) SubtractRows<kQuads>(LU, n, i, 0, i, 1, stride, x);
  for (int i = n - 1; i >= 0; --i) {
    SubtractRows<kQuads>(LU, n, i, n - 1, i, -1, stride, x);
    const double inverse = 1 / LU[static_cast<std::ptrdiff_t>(i) * n + i];
    for (int q = 0; q < kQuads; ++q) QuadAt(x + i * stride + 4 * q) *= inverse;
  }
}

void SolveColumnWithLu(const double* LU, int n, std::ptrdiff_t stride, double* x) {
  for (int k = 0; k < n; ++k) {
    const double* ak = LU + static_cast<std::ptrdiff_t>(k) * n;
    for (int i = k + 1; i < n; ++i) x[i * stride] -= ak[i] * x[k * stride];
  }
  for (int k = n - 1; k >= 0; --k) {
    const double* ak = LU + static_cast<std::ptrdiff_t>(k) * n;
    x[k * stride] *= 1 / ak[k];
    for (int i = 0; i < k; ++i) x[i * stride] -= ak[i] * x[k * stride];
  }
}

// y less four columns of length n, `stride` apart, times factors, one after the other: y is read and written
// once.
void SubtractFour(const double* c0, std::ptrdiff_t stride, const double* factors, int n, double* y) {
  const double *c1 = c0 + stride, *c2 = c1 + stride, *c3 = c2 + stride;
  const double f0 = factors[0], f1 = factors[1], f2 = factors[2], f3 = factors[3];
  ByFours(n, [&](const auto& at) {
    typename decltype(at(y))::PlainObject some = at(y);
    some -= f0 * at(c0);
    some -= f1 * at(c1);
    some -= f2 * at(c2);
    some -= f3 * at(c3);
    at(y) = some;
  });
}

double* Column(double* A, int n, int k) { return A + static_cast<std::ptrdiff_t>(k) * n; }

}  // namespace

namespace {

// Rows of the pivots that are taken together, times what stands above them: c <- L⁻¹ c for four of them.
void SolveUnitLowerFour(const double* L, std::ptrdiff_t stride, double* c) {
  const double *l0 = L, *l1 = L + stride, *l2 = l1 + stride;
  c[1] -= l0[1] * c[0];
  c[2] -= l0[2] * c[0];
  c[2] -= l1[2] * c[1];
  c[3] -= l0[3] * c[0];
  c[3] -= l1[3] * c[1];
  c[3] -= l2[3] * c[2];
}

double LargestOf(const double* x, int n) {
  Quad four = Quad::Zero();
  int i = 0;
  for (; i + 4 <= n; i += 4) four = four.cwiseMax(QuadAt(x + i).cwiseAbs());
  double largest = four.maxCoeff();
  for (; i < n; ++i) largest = std::max(largest, std::abs(x[i]));
  return largest;
}

bool IsZeroFour(const double* x) { return x[0] == 0 && x[1] == 0 && x[2] == 0 && x[3] == 0; }

// What is right of four pivots: rows U of the pivots, and below them C -= L U. L: columns of the pivots, `stride` apart,
// C: the first of `columns` more, both from the row of the first pivot on, `rows` long. Columns whose four numbers in U
// are 0 are passed over, as between loops that share no coordinate.
void EliminateFour(const double* L, double* C, int rows, int columns, std::ptrdiff_t stride) {
  const double *l0 = L + 4, *l1 = l0 + stride, *l2 = l1 + stride, *l3 = l2 + stride;
  for (; columns > 0; --columns, C += stride) {
    if (IsZeroFour(C)) continue;
    SolveUnitLowerFour(L, stride, C);
    const double u0 = C[0], u1 = C[1], u2 = C[2], u3 = C[3];
    double* below = C + 4;
    ByFours(rows - 4, [&](const auto& at) {
      typename decltype(at(below))::PlainObject some = at(below);
      some -= u0 * at(l0);
      some -= u1 * at(l1);
      some -= u2 * at(l2);
      some -= u3 * at(l3);
      at(below) = some;
    });
  }
}

}  // namespace

bool FactorLu(double* A, int n, int* pivots) { return FactorLeadingLu(A, n, n, 1, pivots); }

// By four pivots at a time: what they take from the rest is taken in one go.
bool FactorLeadingLu(double* A, int n, int leading, double threshold, int* pivots) {
  for (int begin = 0; begin < leading; begin += 4) {
    const int end = std::min(begin + 4, leading);
    const bool four = end == begin + 4;
    for (int k = begin; k < end; ++k) {
      double* ak = Column(A, n, k);
      const double largest = LargestOf(ak + k, leading - k);
      if (!(largest > 1e-300)) return false;
      int pivot = k;
      if (!(std::abs(ak[k]) >= threshold * largest)) {
        while (pivot < leading && std::abs(ak[pivot]) != largest) ++pivot;
        if (pivot == leading) return false;  // not numbers
        for (int j = 0; j < n; ++j) std::swap(Column(A, n, j)[k], Column(A, n, j)[pivot]);
      }
      pivots[k] = pivot;
      double* lower = ak + k + 1;
      const double inverse = 1 / ak[k];
      const int others = (four ? end : n) - k - 1;
      ByFours(n - k - 1, [&](const auto& at) {
        const typename decltype(at(lower))::PlainObject some = inverse * at(lower);
        at(lower) = some;
        double* other = lower;
        for (int j = 0; j < others; ++j) {
          other += n;
          at(other) -= other[-1] * some;
        }
      });
    }
    if (!four || end == n) break;
    EliminateFour(Column(A, n, begin) + begin, Column(A, n, end) + begin, n - begin, n - end, n);
  }
  return true;
}

void SolveWithLu(const double* LU, int n, const int* pivots, double* x) {
  SolveLeadingLower(LU, n, n, pivots, x);
  SolveLeadingUpper(LU, n, n, x);
}

void SolveLeadingLower(const double* LU, int n, int leading, const int* pivots, double* x) {
  for (int k = 0; k < leading; ++k)
    if (pivots[k] != k) std::swap(x[k], x[pivots[k]]);
  const auto column = [&](int k) { return LU + static_cast<std::ptrdiff_t>(k) * n; };
  const int whole = leading / 4 * 4;
  for (int k = 0; k < whole; k += 4) {
    SolveUnitLowerFour(column(k) + k, n, x + k);
    SubtractFour(column(k) + k + 4, n, x + k, n - k - 4, x + k + 4);
  }
  for (int k = whole; k < leading; ++k) Subtract(x[k], column(k) + k + 1, n - k - 1, x + k + 1);
}

void SolveLeadingUpper(const double* LU, int n, int leading, double* x) {
  const auto column = [&](int k) { return LU + static_cast<std::ptrdiff_t>(k) * n; };
  const int whole = leading / 4 * 4;
  int j = n;
  for (; j >= leading + 4; j -= 4) SubtractFour(column(j - 4), n, x + j - 4, leading, x);
  for (; j > leading; --j) Subtract(x[j - 1], column(j - 1), leading, x);
  for (int k = leading - 1; k >= whole; --k) {
    const double* ak = column(k);
    x[k] /= ak[k];
    for (int i = whole; i < k; ++i) x[i] -= ak[i] * x[k];
    ByFours(whole, [&](const auto& at) { at(x) -= x[k] * at(ak); });
  }
  for (int k = whole - 4; k >= 0; k -= 4) {
    const double *a0 = column(k), *a1 = a0 + n, *a2 = a1 + n, *a3 = a2 + n;
    double* y = x + k;
    y[3] /= a3[k + 3];
    y[2] = (y[2] - a3[k + 2] * y[3]) / a2[k + 2];
    y[1] = (y[1] - a3[k + 1] * y[3] - a2[k + 1] * y[2]) / a1[k + 1];
    y[0] = (y[0] - a3[k] * y[3] - a2[k] * y[2] - a1[k] * y[1]) / a0[k];
    const double last_first[] = {y[3], y[2], y[1], y[0]};
    SubtractFour(a3, -static_cast<std::ptrdiff_t>(n), last_first, k, x);
  }
}

void SolveRowsWithLu(const double* LU, int n, const int* pivots, int columns, double* x) {
  const auto row = [&](int i) { return x + static_cast<std::ptrdiff_t>(i) * columns; };
  for (int k = 0; k < n; ++k)
    if (pivots[k] != k) std::swap_ranges(row(k), row(k) + columns, row(pivots[k]));
  int c = 0;
  for (; c + 16 <= columns; c += 16) SolveQuadsWithLu<4>(LU, n, columns, x + c);
  for (; c + 12 <= columns; c += 12) SolveQuadsWithLu<3>(LU, n, columns, x + c);
  for (; c + 8 <= columns; c += 8) SolveQuadsWithLu<2>(LU, n, columns, x + c);
  for (; c + 4 <= columns; c += 4) SolveQuadsWithLu<1>(LU, n, columns, x + c);
  for (; c < columns; ++c) SolveColumnWithLu(LU, n, columns, x + c);
}

namespace {

// Products of four columns of length n, `stride` apart, with x.
Quad FourDots(const double* c0, std::ptrdiff_t stride, int n, const double* x) {
  const double *c1 = c0 + stride, *c2 = c1 + stride, *c3 = c2 + stride;
  Quad s0 = Quad::Zero(), s1 = Quad::Zero(), s2 = Quad::Zero(), s3 = Quad::Zero();
  int i = 0;
  for (; i + 4 <= n; i += 4) {
    const Quad some = QuadAt(x + i);
    s0 += some.cwiseProduct(QuadAt(c0 + i));
    s1 += some.cwiseProduct(QuadAt(c1 + i));
    s2 += some.cwiseProduct(QuadAt(c2 + i));
    s3 += some.cwiseProduct(QuadAt(c3 + i));
  }
  Quad sum(s0.sum(), s1.sum(), s2.sum(), s3.sum());
  for (; i < n; ++i) sum += x[i] * Quad(c0[i], c1[i], c2[i], c3[i]);
  return sum;
}

}  // namespace

void SolveTransposedWithLu(const double* LU, int n, const int* pivots, double* x) {
  SolveLeadingUpperTransposed(LU, n, n, x);
  SolveLeadingLowerTransposed(LU, n, n, pivots, x);
}

void SolveLeadingUpperTransposed(const double* LU, int n, int leading, double* x) {
  const auto column = [&](int k) { return LU + static_cast<std::ptrdiff_t>(k) * n; };
  const int whole = leading / 4 * 4;
  for (int k = 0; k < leading;) {
    const int end = k < whole ? k + 4 : leading, begin = k;
    if (k < whole) QuadAt(x + k) -= FourDots(column(k), n, k, x);
    for (; k < end; ++k) {
      const double* ak = column(k);
      double sum = x[k];
      for (int i = begin < whole ? begin : 0; i < k; ++i) sum -= ak[i] * x[i];
      x[k] = sum / ak[k];
    }
  }
  int k = leading;
  for (; k + 4 <= n; k += 4) QuadAt(x + k) -= FourDots(column(k), n, leading, x);
  for (; k < n; ++k)
    for (int i = 0; i < leading; ++i) x[k] -= column(k)[i] * x[i];
}

void SolveLeadingLowerTransposed(const double* LU, int n, int leading, const int* pivots, double* x) {
  const auto column = [&](int k) { return LU + static_cast<std::ptrdiff_t>(k) * n; };
  const int whole = leading / 4 * 4;
  for (int end = leading; end > 0;) {
    const int begin = end > whole ? whole : end - 4;
    const bool four = begin < whole;
    if (four) QuadAt(x + begin) -= FourDots(column(begin) + end, n, n - end, x + end);
    for (int k = end - 1; k >= begin; --k) {
      const double* ak = column(k);
      double sum = x[k];
      for (int i = k + 1; i < (four ? end : n); ++i) sum -= ak[i] * x[i];
      x[k] = sum;
    }
    end = begin;
  }
  for (int k = leading - 1; k >= 0; --k)
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

// Four columns at a time.
bool FactorCholesky(double* A, int n) {
  const int whole = n / 4 * 4;
  const auto is_pivot = [](double d) { return d > 0 && std::isfinite(d); };
  for (int begin = 0; begin < whole; begin += 4) {
    double *c0 = Column(A, n, begin) + begin, *c1 = c0 + n, *c2 = c1 + n, *c3 = c2 + n;
    if (begin > 0)
      ByFours(n - begin, [&](const auto& at) {
        using Some = typename decltype(at(c0))::PlainObject;
        Some a0 = at(c0), a1 = at(c1), a2 = at(c2), a3 = at(c3);
        const double* before = A + begin;
        for (int k = 0; k < begin; ++k, before += n) {
          const Some some = at(before);
          a0 -= before[0] * some;
          a1 -= before[1] * some;
          a2 -= before[2] * some;
          a3 -= before[3] * some;
        }
        at(c0) = a0;
        at(c1) = a1;
        at(c2) = a2;
        at(c3) = a3;
      });
    if (!is_pivot(c0[0])) return false;
    c0[0] = std::sqrt(c0[0]);
    const double i0 = 1 / c0[0], l10 = c0[1] *= i0, l20 = c0[2] *= i0, l30 = c0[3] *= i0;
    c1[1] -= l10 * l10;
    if (!is_pivot(c1[1])) return false;
    c1[1] = std::sqrt(c1[1]);
    const double i1 = 1 / c1[1], l21 = c1[2] = (c1[2] - l20 * l10) * i1,
                 l31 = c1[3] = (c1[3] - l30 * l10) * i1;
    c2[2] -= l20 * l20 + l21 * l21;
    if (!is_pivot(c2[2])) return false;
    c2[2] = std::sqrt(c2[2]);
    const double i2 = 1 / c2[2], l32 = c2[3] = (c2[3] - l30 * l20 - l31 * l21) * i2;
    c3[3] -= l30 * l30 + l31 * l31 + l32 * l32;
    if (!is_pivot(c3[3])) return false;
    c3[3] = std::sqrt(c3[3]);
    const double i3 = 1 / c3[3];
    double *b0 = c0 + 4, *b1 = c1 + 4, *b2 = c2 + 4, *b3 = c3 + 4;
    ByFours(n - begin - 4, [&](const auto& at) {
      using Some = typename decltype(at(b0))::PlainObject;
      const Some v0 = i0 * at(b0), v1 = i1 * (at(b1) - l10 * v0), v2 = i2 * (at(b2) - l20 * v0 - l21 * v1),
                 v3 = i3 * (at(b3) - l30 * v0 - l31 * v1 - l32 * v2);
      at(b0) = v0;
      at(b1) = v1;
      at(b2) = v2;
      at(b3) = v3;
    });
  }
  for (int j = whole; j < n; ++j) {
    double* aj = Column(A, n, j);
    for (int k = 0; k < j; ++k) {
      const double* ak = Column(A, n, k);
      for (int i = j; i < n; ++i) aj[i] -= ak[j] * ak[i];
    }
    if (!is_pivot(aj[j])) return false;
    aj[j] = std::sqrt(aj[j]);
    for (int i = j + 1; i < n; ++i) aj[i] /= aj[j];
  }
  return true;
}

void SolveWithCholesky(const double* L, int n, double* x) {
  const int whole = n / 4 * 4;
  const auto column = [&](int k) { return L + static_cast<std::ptrdiff_t>(k) * n; };
  for (int begin = 0; begin < whole; begin += 4) {
    const double *c0 = column(begin) + begin, *c1 = c0 + n, *c2 = c1 + n, *c3 = c2 + n;
    double* y = x + begin;
    y[0] /= c0[0];
    y[1] = (y[1] - c0[1] * y[0]) / c1[1];
    y[2] = (y[2] - c0[2] * y[0] - c1[2] * y[1]) / c2[2];
    y[3] = (y[3] - c0[3] * y[0] - c1[3] * y[1] - c2[3] * y[2]) / c3[3];
    SubtractFour(c0 + 4, n, y, n - begin - 4, y + 4);
  }
  for (int k = whole; k < n; ++k) {
    x[k] /= column(k)[k];
    for (int i = k + 1; i < n; ++i) x[i] -= column(k)[i] * x[k];
  }
  for (int k = n - 1; k >= whole; --k) {
    for (int i = k + 1; i < n; ++i) x[k] -= column(k)[i] * x[i];
    x[k] /= column(k)[k];
  }
  for (int begin = whole - 4; begin >= 0; begin -= 4) {
    const double *c0 = column(begin) + begin, *c1 = c0 + n, *c2 = c1 + n, *c3 = c2 + n;
    double* y = x + begin;
    QuadAt(y) -= FourDots(c0 + 4, n, n - begin - 4, y + 4);
    y[3] /= c3[3];
    y[2] = (y[2] - c2[3] * y[3]) / c2[2];
    y[1] = (y[1] - c1[2] * y[2] - c1[3] * y[3]) / c1[1];
    y[0] = (y[0] - c0[1] * y[1] - c0[2] * y[2] - c0[3] * y[3]) / c0[0];
  }
}

}  // namespace fork1s
