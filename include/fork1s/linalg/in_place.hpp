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
