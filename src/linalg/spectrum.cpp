#include <fork1s/linalg/spectrum.hpp>

#include <Eigen/Eigenvalues>

namespace fork1s {

SymmetricSpectrum SpectrumOf(const MatrixX& symmetric) {
  if (symmetric.size() == 0) return {VectorX(0), MatrixX(0, 0)};
  const Eigen::SelfAdjointEigenSolver<MatrixX> solver(symmetric);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

VectorX EigenvaluesOf(const MatrixX& symmetric) {
  if (symmetric.size() == 0) return VectorX(0);
  return Eigen::SelfAdjointEigenSolver<MatrixX>(symmetric, Eigen::EigenvaluesOnly).eigenvalues();
}

Vector3 PrincipalValues(const Matrix3& symmetric) {
  return Eigen::SelfAdjointEigenSolver<Matrix3>(symmetric, Eigen::EigenvaluesOnly).eigenvalues();
}

VectorX EigenvaluesOf(const MatrixX& K, const MatrixX& M) {
  if (K.size() == 0) return VectorX(0);
  return Eigen::GeneralizedSelfAdjointEigenSolver<MatrixX>(K, M, Eigen::EigenvaluesOnly).eigenvalues();
}

GeneralSpectrum GeneralSpectrumOf(const MatrixX& A) {
  if (A.size() == 0) return {};
  const Eigen::EigenSolver<MatrixX> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace fork1s
