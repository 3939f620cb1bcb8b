// A sum of products by registers of four.
#pragma once

#include <fork1s/base/quad.hpp>

namespace fork1s {

/// Σ a_k b_k over n numbers, by fours from the first on: the same bits wherever they stand. Compilers keep the order
/// of a plain sum, one product after the other.
inline double DotByFours(const double* a, const double* b, int n) {
  const int fours = n & ~3;
  double sum = 0;
  if (fours > 0) {
    Quad some = QuadAt(a).cwiseProduct(QuadAt(b));
    for (int k = 4; k < fours; k += 4) some += QuadAt(a + k).cwiseProduct(QuadAt(b + k));
    sum = some.sum();
  }
  for (int k = fours; k < n; ++k) sum += a[k] * b[k];
  return sum;
}

}  // namespace fork1s
