#include <fork1s/linalg/cholesky.hpp>

#include <Eigen/Cholesky>

namespace fork1s {

bool CholeskyInPlace(Eigen::Ref<MatrixX> A) {
  const Eigen::LLT<Eigen::Ref<MatrixX>> llt(A);
  return llt.info() == Eigen::Success;
}

bool Cholesky::Compute(const MatrixX& A) {
  L_ = A;
  ok_ = L_.size() == 0 || CholeskyInPlace(L_);
  return ok_;
}

void SolveWithLowerInPlace(const Eigen::Ref<const MatrixX>& L, Eigen::Ref<VectorX> x) {
  L.triangularView<Eigen::Lower>().solveInPlace(x);
  L.triangularView<Eigen::Lower>().transpose().solveInPlace(x);
}

void Cholesky::SolveInPlace(VectorX& x) const {
  if (L_.size() == 0) return;
  L_.triangularView<Eigen::Lower>().solveInPlace(x);
  L_.triangularView<Eigen::Lower>().transpose().solveInPlace(x);
}

void Cholesky::SolveInPlace(MatrixX& x) const {
  if (L_.size() == 0 || x.cols() == 0) return;
  L_.triangularView<Eigen::Lower>().solveInPlace(x);
  L_.triangularView<Eigen::Lower>().transpose().solveInPlace(x);
}

Vector6 SolvePositive(const Matrix6& A, const Vector6& b) { return A.llt().solve(b); }

void SymmetricFactor::Compute(const MatrixX& A) {
  const Eigen::LDLT<MatrixX> ldlt(A);
  LD_ = ldlt.matrixLDLT();
  swaps_ = ldlt.transpositionsP().indices();
}

MatrixX SymmetricFactor::Solve(const MatrixX& B) const {
  if (LD_.size() == 0 || B.cols() == 0) return B;
  const Eigen::Transpositions<Eigen::Dynamic> P(swaps_);
  MatrixX x = P * B;
  LD_.triangularView<Eigen::UnitLower>().solveInPlace(x);
  for (Eigen::Index i = 0; i < x.rows(); ++i) {
    // As in Eigen: a pivot of zero stands for a direction without load.
    const double d = LD_(i, i);
    if (std::abs(d) > std::numeric_limits<double>::min())
      x.row(i) /= d;
    else
      x.row(i).setZero();
  }
  LD_.triangularView<Eigen::UnitLower>().transpose().solveInPlace(x);
  return P.transpose() * x;
}

MatrixX SolveSymmetric(const MatrixX& A, const MatrixX& B) { return SymmetricFactor(A).Solve(B); }

}  // namespace fork1s
