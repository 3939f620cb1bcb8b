#include "linalg/solve.hpp"

#include <Eigen/SparseLU>

namespace fork1s {

struct SparseLu::Detail {
  Eigen::SparseLU<Eigen::SparseMatrix<double>> lu;
};

SparseLu::SparseLu() : detail_(std::make_unique<Detail>()) {}
SparseLu::~SparseLu() = default;
SparseLu::SparseLu(SparseLu&&) noexcept = default;
SparseLu& SparseLu::operator=(SparseLu&&) noexcept = default;

bool SparseLu::Compute(const Eigen::SparseMatrix<double>& A, bool same_pattern) {
  if (!same_pattern) detail_->lu.analyzePattern(A);
  detail_->lu.factorize(A);
  return detail_->lu.info() == Eigen::Success;
}

MatrixX SparseLu::Solve(const MatrixX& B) const { return detail_->lu.solve(B); }

}  // namespace fork1s
