// Decompositions on storage of the caller: nothing allocates, and the same numbers give the same bits
// wherever they stand. Matrices are column-major without gaps.
#pragma once

namespace fork1s {

/// P A = L U with row pivoting; A n x n is overwritten. False where a pivot vanishes.
bool FactorLu(double* A, int n, int* pivots);
/// x <- A⁻¹ x
void SolveWithLu(const double* LU, int n, const int* pivots, double* x);
/// The same for `columns` right sides, x [n x columns] row by row without gaps.
void SolveRowsWithLu(const double* LU, int n, const int* pivots, int columns, double* x);
/// x <- A⁻ᵀ x
void SolveTransposedWithLu(const double* LU, int n, const int* pivots, double* x);

/// The first `leading` steps of P A = L U, pivots among the first `leading` rows: A holds these columns of L, rows of U,
/// and behind both the Schur complement of the rest. A diagonal entry is kept as pivot where it is at least `threshold`
/// times the largest entry of its column in those rows. False where a pivot vanishes.
bool FactorLeadingLu(double* A, int n, int leading, double threshold, int* pivots);
/// Of x [n] with these steps: x <- L⁻¹ P x, the last n - leading numbers less what the first contribute to them.
void SolveLeadingLower(const double* LU, int n, int leading, const int* pivots, double* x);
/// The first `leading` numbers of x <- U⁻¹ x; the others are known.
void SolveLeadingUpper(const double* LU, int n, int leading, double* x);
/// The same for Uᵀ, forward, and for Lᵀ, backward.
void SolveLeadingUpperTransposed(const double* LU, int n, int leading, double* x);
void SolveLeadingLowerTransposed(const double* LU, int n, int leading, const int* pivots, double* x);

/// Y <- L⁻¹ Y for the lower triangle of L (n x n), columns of L and of Y (n x columns) `stride` and
/// `Y_stride` apart. What is 0 at the top of four columns costs nothing.
void SolveLower(const double* L, int n, int stride, double* Y, int columns, int Y_stride);

/// A = L Lᵀ, n x n, of which only the lower triangle is read and overwritten by L. False where A is not
/// positive definite.
bool FactorCholesky(double* A, int n);
/// x <- A⁻¹ x by that L.
void SolveWithCholesky(const double* L, int n, double* x);

/// A = Q R for A with rows >= columns, by Householder: R, upper triangular, in its first rows, zeros below
/// its diagonal.
void TriangularRoot(double* A, int rows, int columns);

}  // namespace fork1s
