// Factors of positive definite and symmetric matrices.
#pragma once

#include <fork1s/base/types.hpp>
#include <utility>
#include <vector>

namespace fork1s {

/// Rows and columns [begin, begin + size) of a matrix.
struct DiagonalBlock {
  int begin = 0, size = 0;
};

/// A = L Lᵀ. Holds its storage: computing and solving for a size it had before do not allocate.
class Cholesky {
 public:
  /// From now on A is 0 outside of these blocks, which cover it in their order. What is outside is not read.
  /// With `last_first` L is that of each block with its rows and columns from the last to the first: what the
  /// first ones couple, a base its legs, then fills nothing else in.
  void Divide(std::vector<DiagonalBlock> blocks, bool last_first = false) {
    blocks_ = std::move(blocks);
    last_first_ = last_first;
  }
  /// Only the lower triangle of A is read. False where A is not positive definite.
  bool Compute(const MatrixX& A);
  bool ok() const { return ok_; }
  int size() const { return static_cast<int>(L_.rows()); }
  /// L in the lower triangle, of a block that goes from its last to its first in that order; what stands
  /// above it means nothing.
  const MatrixX& L() const { return L_; }
  /// x <- A⁻¹ x
  void SolveInPlace(VectorX& x) const;
  void SolveInPlace(MatrixX& x) const;
  /// x <- L⁻¹ x, of a matrix that was not divided.
  void SolveLowerInPlace(MatrixX& x) const;

 private:
  MatrixX L_;
  std::vector<DiagonalBlock> blocks_;  // none: the whole
  bool last_first_ = false;
  bool ok_ = false;
};

/// The same in place: the lower triangle of A becomes L. False where A is not positive definite.
bool CholeskyInPlace(Eigen::Ref<MatrixX> A);

/// x <- (L Lᵀ)⁻¹ x for the lower triangle of L.
void SolveWithLowerInPlace(const Eigen::Ref<const MatrixX>& L, Eigen::Ref<VectorX> x);

/// A⁻¹ b for positive definite A.
Vector6 SolvePositive(const Matrix6& A, const Vector6& b);
/// Y with YᵀY = A⁻¹ for positive definite A; not numbers for another A.
Matrix6 InverseRoot(const Matrix6& A);

/// A = P Lᵀ D L Pᵀ of a symmetric matrix, indefinite or not; solves many right sides.
class SymmetricFactor {
 public:
  SymmetricFactor() = default;
  explicit SymmetricFactor(const MatrixX& A) { Compute(A); }
  void Compute(const MatrixX& A);
  MatrixX Solve(const MatrixX& B) const;

 private:
  MatrixX LD_;  // unit lower L, D on the diagonal
  Eigen::Matrix<int, Eigen::Dynamic, 1> swaps_;
};

/// A⁻¹ B for symmetric A.
MatrixX SolveSymmetric(const MatrixX& A, const MatrixX& B);

}  // namespace fork1s
