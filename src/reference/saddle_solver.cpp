#include "saddle_solver.hpp"

#include <limits>

namespace fork1s::internal {

void SaddleSolver::Begin(int size) {
  size_ = size;
  entries_.clear();
  shift_.setZero(size);
}

void SaddleSolver::AddBlock(int row, int column, const Eigen::Ref<const MatrixX>& block) {
  for (Eigen::Index j = 0; j < block.cols(); ++j)
    for (Eigen::Index i = 0; i < block.rows(); ++i)
      Add(row + static_cast<int>(i), column + static_cast<int>(j), block(i, j));
}

void SaddleSolver::AddPair(int row, int column, const Eigen::Ref<const MatrixX>& block) {
  AddBlock(row, column, block);
  AddBlock(column, row, block.transpose());
}

void SaddleSolver::Assemble() {
  // Every diagonal entry exists, so that the pattern does not depend on which rows are shifted.
  for (int i = 0; i < size_; ++i) Add(i, i, -shift_(i));
  K_.resize(size_, size_);
  K_.setFromTriplets(entries_.begin(), entries_.end());
  K_.makeCompressed();
}

bool SaddleSolver::Factor() {
  Assemble();
  if (size_ == 0) return true;
  const bool same_pattern = analysed_entries_ == K_.nonZeros();
  analysed_entries_ = K_.nonZeros();
  return factor_.Compute(K_, same_pattern);
}

MatrixX SaddleSolver::Multiply(const MatrixX& x) const {
  MatrixX y = K_ * x;
  y += shift_.asDiagonal() * x;
  return y;
}

bool SaddleSolver::Solve(MatrixX& b) const {
  if (size_ == 0) return true;
  MatrixX x = factor_.Solve(b);
  if (!x.allFinite()) return false;
  // What ε leaves over shrinks by ε over an eigenvalue of the constraints each time; where it no longer
  // does, rounding is reached, or the rows contradict each other.
  double before = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 8; ++i) {
    const MatrixX r = b - Multiply(x);
    const double left = r.norm();
    if (!(left < 0.5 * before) || left <= 1e-16 * b.norm()) break;
    before = left;
    const MatrixX better = x + factor_.Solve(r);
    if (!better.allFinite()) break;
    x = better;
  }
  b = std::move(x);
  return true;
}

}  // namespace fork1s::internal
