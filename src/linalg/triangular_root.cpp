#include <cmath>
#include <cstddef>
#include <fork1s/base/quad.hpp>

#include "linalg/in_place.hpp"

namespace fork1s {

void TriangularRoot(double* A, int rows, int columns) {
  for (int k = 0; k < columns; ++k) {
    double* v = A + static_cast<std::ptrdiff_t>(k) * rows;
    double norm2 = 0;
    for (int i = k; i < rows; ++i) norm2 += v[i] * v[i];
    if (!(norm2 > 0)) continue;
    const double end = v[k] > 0 ? -std::sqrt(norm2) : std::sqrt(norm2), head = v[k] - end;
    // The reflection 1 − 2 v vᵀ/vᵀv with v = (head, rest) takes the column to (end, 0).
    const double length2 = norm2 - v[k] * v[k] + head * head;
    if (length2 > 0)
      for (int j = k + 1; j < columns; ++j) {
        double* a = A + static_cast<std::ptrdiff_t>(j) * rows;
        double dot = head * a[k];
        for (int i = k + 1; i < rows; ++i) dot += v[i] * a[i];
        const double factor = 2 * dot / length2;
        a[k] -= factor * head;
        const double* rest = v + k + 1;
        double* to = a + k + 1;
        ByFours(rows - k - 1, [&](const auto& at) { at(to) -= factor * at(rest); });
      }
    v[k] = end;
    for (int i = k + 1; i < rows; ++i) v[i] = 0;
  }
}

}  // namespace fork1s
