#include "linalg/spectrum.hpp"

#include <limits>

#include <Eigen/Eigenvalues>

#include "linalg/cholesky.hpp"

namespace fork1s {

SymmetricSpectrum SpectrumOf(const MatrixX& symmetric) {
  if (symmetric.size() == 0) return {VectorX(0), MatrixX(0, 0)};
  const Eigen::SelfAdjointEigenSolver<MatrixX> solver(symmetric);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Matrix3 PositivePart(const Matrix3& symmetric) {
  Eigen::SelfAdjointEigenSolver<Matrix3> modes;
  modes.computeDirect(symmetric);
  const Matrix3& N = modes.eigenvectors();
  return N * modes.eigenvalues().cwiseMax(0).asDiagonal() * N.transpose();
}

VectorX EigenvaluesOf(const MatrixX& symmetric) {
  if (symmetric.size() == 0) return VectorX(0);
  return Eigen::SelfAdjointEigenSolver<MatrixX>(symmetric, Eigen::EigenvaluesOnly).eigenvalues();
}

Vector3 PrincipalValues(const Matrix3& symmetric) {
  return Eigen::SelfAdjointEigenSolver<Matrix3>(symmetric, Eigen::EigenvaluesOnly).eigenvalues();
}

VectorX EigenvaluesOf(const MatrixX& K, const MatrixX& M) {
  Cholesky of_M;
  if (!of_M.Compute(M)) return VectorX::Constant(K.rows(), std::numeric_limits<double>::quiet_NaN());
  MatrixX Z = K;
  of_M.SolveLowerInPlace(Z);
  Z.transposeInPlace();
  of_M.SolveLowerInPlace(Z);  // L⁻¹ K L⁻ᵀ
  return EigenvaluesOf(Z);
}

GeneralSpectrum GeneralSpectrumOf(const MatrixX& A) {
  if (A.size() == 0) return {};
  const Eigen::EigenSolver<MatrixX> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace fork1s
