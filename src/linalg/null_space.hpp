// Null spaces, ranges and complements, by the policy of rank.hpp.
#pragma once

#include <vector>

#include "linalg/rank.hpp"

namespace fork1s {

/// What a matrix A (m x n, in one unit) does and does not see.
struct NullSpace {
  Rank rank;
  MatrixX seen;                       ///< n x rank, orthonormal: the range of Aᵀ
  MatrixX unseen;                     ///< n x (n - rank), orthonormal: A unseen = 0 within the threshold
  std::vector<int> independent_rows;  ///< rank rows of A that span the others, ascending
  VectorX doubtful;  ///< n: the direction nearest the threshold where the rank is doubtful, else empty
};

/// By QR with pivoting; where its diagonal leaves less than a millionfold gap, by singular values.
NullSpace ComputeNullSpace(const MatrixX& A);

/// Orthonormal basis of what the orthonormal columns of Y (n x k) leave: n x (n - k).
MatrixX OrthogonalComplement(const MatrixX& Y);

/// Columns that span what those of B (n x k, independent) span, each with an entry where all others have 0, and
/// a largest entry of 1: as sparse as elimination makes them.
MatrixX EchelonBasis(MatrixX B);

/// Orthonormal basis of the range of A (m x n, in one unit): m x rank.
MatrixX RangeBasis(const MatrixX& A);

/// For B (m x n) of full column rank, whose rows may differ by many orders of magnitude: W (n x n) with
/// (B W)ᵀ(B W) = 1. Rows are sorted by size and columns pivoted, so that each row keeps its own digits (Cox
/// and Higham 1998).
MatrixX OrthonormalisingFactor(const MatrixX& B);

/// B (B W) of the same: an orthonormal basis of the range of B (m x n).
MatrixX GradedRangeBasis(const MatrixX& B);

}  // namespace fork1s
