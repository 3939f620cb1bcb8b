// Sums of few outer products.
#pragma once

#include <fork1s/base/quad.hpp>

namespace fork1s {

/// out <- A Bᵀ, A [rows x K], B [columns x K], out [rows x columns], each stored column after column without gaps, out
/// apart from both. For small K: a general product spends more on packing than on these. No allocation.
template <int K>
void OuterProducts(const double* A, const double* B, int rows, int columns, double* out) {
  for (int j = 0; j < columns; ++j, out += rows)
    ByFours(rows, [&](const auto& at) {
      auto sum = (at(A) * B[j]).eval();
      for (int k = 1; k < K; ++k) sum += at(A + k * rows) * B[j + k * columns];
      at(out) = sum;
    });
}

}  // namespace fork1s
