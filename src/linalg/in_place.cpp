#include <fork1s/linalg/in_place.hpp>

#include <cmath>
#include <cstddef>
#include <utility>

namespace fork1s {
namespace {

// Plain loops, not Eigen's: where Eigen starts its packets depends on the address, and with it the last bit.
void Subtract(double factor, const double* __restrict x, int n, double* __restrict y) {
  for (int i = 0; i < n; ++i) y[i] -= factor * x[i];
}

double* Column(double* A, int n, int k) { return A + static_cast<std::ptrdiff_t>(k) * n; }

}  // namespace

bool FactorLu(double* A, int n, int* pivots) {
  for (int k = 0; k < n; ++k) {
    double* ak = Column(A, n, k);
    int pivot = k;
    for (int i = k + 1; i < n; ++i)
      if (std::abs(ak[i]) > std::abs(ak[pivot])) pivot = i;
    if (!(std::abs(ak[pivot]) > 1e-300)) return false;
    pivots[k] = pivot;
    if (pivot != k)
      for (int j = 0; j < n; ++j) std::swap(Column(A, n, j)[k], Column(A, n, j)[pivot]);
    const int rest = n - k - 1;
    double* lower = ak + k + 1;
    const double inverse = 1 / ak[k];
    for (int i = 0; i < rest; ++i) lower[i] *= inverse;
    for (int j = k + 1; j < n; ++j) {
      double* aj = Column(A, n, j);
      if (aj[k] != 0) Subtract(aj[k], lower, rest, aj + k + 1);
    }
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

bool SolveByCholesky(double* A, int n, double* x) {
  for (int k = 0; k < n; ++k) {
    double* ak = Column(A, n, k);
    if (!(ak[k] > 0) || !std::isfinite(ak[k])) return false;
    const double root = std::sqrt(ak[k]), inverse = 1 / root;
    ak[k] = root;
    for (int i = k + 1; i < n; ++i) ak[i] *= inverse;
    for (int j = k + 1; j < n; ++j)
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
