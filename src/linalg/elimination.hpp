// Bases by elimination: a quarter of what orthogonal decompositions cost. They decide nothing that is not
// clear: where they answer no, null_space.hpp knows.
#pragma once

#include <fork1s/base/types.hpp>

namespace fork1s {

/// The solutions of A x = 0 for rows A (m x n, in one unit): Z (n x (n - m)) with each column 1 at a
/// coordinate where the others are 0. False where the rows are not clearly independent, or Z would lose
/// digits.
bool EliminatedNullSpace(const MatrixX& A, MatrixX& Z);

/// Z <- Z W with (B W)ᵀ(B W) = 1 for B (m x k) and Z (n x k), by the root of BᵀB. Returns the largest entry
/// of BᵀB - 1 as it was, infinite where BᵀB has no root and Z is left as it was. Off by rounding times the
/// square of B's condition number: a second time, with B W, takes that to rounding where the entry is far
/// below 1 then.
double DivideByRoot(const MatrixX& B, MatrixX& Z);

}  // namespace fork1s
