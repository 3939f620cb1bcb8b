// Products of dense matrices, compiled once: every kind that a file spells out it compiles for itself, and a
// triple product is three. For what is done now and then; a step writes its products into storage of its own.
#pragma once

#include <fork1s/base/types.hpp>

namespace fork1s {

using MatrixView = Eigen::Ref<const MatrixX, 0, Eigen::OuterStride<>>;
using VectorView = Eigen::Ref<const VectorX>;

/// A B
MatrixX Times(const MatrixView& A, const MatrixView& B);
/// Aᵀ B
MatrixX TransposedTimes(const MatrixView& A, const MatrixView& B);
/// A Bᵀ
MatrixX TimesTransposed(const MatrixView& A, const MatrixView& B);
/// diag(d) A
MatrixX ScaledRows(const VectorView& d, const MatrixView& A);
/// A diag(d)
MatrixX ScaledColumns(const MatrixView& A, const VectorView& d);
/// Aᵀ M A
MatrixX Congruence(const MatrixView& M, const MatrixView& A);
/// A Aᵀ - B Bᵀ, of which one half is computed.
MatrixX DifferenceOfSquares(const MatrixView& A, const MatrixView& B);
/// Aᵀ diag(d) A
MatrixX DiagonalCongruence(const VectorView& d, const MatrixView& A);

}  // namespace fork1s
