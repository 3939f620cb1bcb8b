// Rows, columns and entries picked by their numbers, compiled once for the reason of products.hpp.
#pragma once

#include <vector>

#include "linalg/products.hpp"

namespace fork1s {

/// A with only the columns `at`, in that order.
MatrixX Columns(const MatrixView& A, const std::vector<int>& at);
MatrixX Rows(const MatrixView& A, const std::vector<int>& at);
MatrixX RowsAndColumns(const MatrixView& A, const std::vector<int>& rows, const std::vector<int>& columns);
VectorX Entries(const VectorView& v, const std::vector<int>& at);
/// n numbers, 0 but for those `at`, which are v.
VectorX Spread(const VectorView& v, const std::vector<int>& at, int n);

}  // namespace fork1s
