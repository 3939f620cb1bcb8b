// Sums of few outer products.
#pragma once

#include <fork1s/base/quad.hpp>

namespace fork1s {

namespace internal {

// Columns j to j + kColumns of OuterProducts.
template <int K, int kColumns>
void OuterProductColumns(const double* A, const double* B, int rows, int columns, double* out) {
  ByFours(rows, [&](const auto& at) {
    using Part = typename decltype(at(A).eval())::PlainObject;
    Part sum[kColumns];
    for (Part& s : sum) s.setZero();
    const double *a = A, *b = B;
    for (int k = 0; k < K; ++k, a += rows, b += columns) {
      const Part own = at(a);
      for (int c = 0; c < kColumns; ++c) sum[c] += own * b[c];
    }
    for (int c = 0; c < kColumns; ++c) at(out + c * rows) = sum[c];
  });
}

}  // namespace internal

/// out <- A Bᵀ, A [rows x K], B [columns x K], out [rows x columns], each stored column after column without gaps, out
/// apart from both. For small K: a general product spends more on packing than on these. No allocation.
template <int K>
void OuterProducts(const double* A, const double* B, int rows, int columns, double* out) {
  int j = 0;
  for (; j + 4 <= columns; j += 4)
    internal::OuterProductColumns<K, 4>(A, B + j, rows, columns, out + j * rows);
  for (; j < columns; ++j) internal::OuterProductColumns<K, 1>(A, B + j, rows, columns, out + j * rows);
}

}  // namespace fork1s
