#include <fork1s/linalg/spectrum.hpp>

#include <Eigen/SVD>

namespace fork1s {

VectorX SingularValues(const MatrixX& A) {
  if (A.size() == 0) return VectorX(0);
  return Eigen::BDCSVD<MatrixX>(A).singularValues();
}

SingularSpectrum LeftSingular(const MatrixX& A) {
  if (A.size() == 0) return {VectorX(0), MatrixX(A.rows(), 0)};
  const Eigen::BDCSVD<MatrixX> svd(A, Eigen::ComputeThinU);
  return {svd.singularValues(), svd.matrixU()};
}

SingularSpectrum RightSingular(const MatrixX& A) {
  if (A.size() == 0) return {VectorX(0), MatrixX::Identity(A.cols(), A.cols())};
  const Eigen::BDCSVD<MatrixX> svd(A, Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixV()};
}

}  // namespace fork1s
