// Sparse symmetric systems [A Gᵀ; G 0] of masses, springs and constraints.
#pragma once

#include <fork1s/base/types.hpp>
#include <vector>

#include "linalg/solve.hpp"

namespace fork1s::internal {

/// Rows that may depend on each other (loops closed more often than needed) are shifted by a small -ε on the
/// diagonal; solutions are refined against the unshifted matrix, so that ε does not show in them. With the
/// same sequence of Add calls after every Begin the fill-reducing order is found once.
class SaddleSolver {
 public:
  void Begin(int size);
  int size() const { return size_; }
  void Add(int row, int column, double value) { entries_.emplace_back(row, column, value); }
  void AddBlock(int row, int column, const Eigen::Ref<const MatrixX>& block);
  /// The block, and its transpose on the other side of the diagonal.
  void AddPair(int row, int column, const Eigen::Ref<const MatrixX>& block);
  /// Shifts a constraint row by -ε.
  void Shift(int row, double epsilon) { shift_(row) = epsilon; }

  /// Gathers what was added; Factor does so too.
  void Assemble();
  /// False where the matrix is singular.
  bool Factor();
  /// x = K⁻¹ b for every column of b, in place; refined where rows are shifted. False for results that are
  /// not finite.
  bool Solve(MatrixX& b) const;
  /// The unshifted matrix times x.
  MatrixX Multiply(const MatrixX& x) const;

 private:
  int size_ = 0;
  std::vector<Eigen::Triplet<double>> entries_;
  VectorX shift_;
  Eigen::SparseMatrix<double> K_;  // shifted
  SparseLu factor_;
  Eigen::Index analysed_entries_ = -1;
};

}  // namespace fork1s::internal
