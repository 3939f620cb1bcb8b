#include <fork1s/linalg/spectrum.hpp>

#include <Eigen/SVD>

// By Jacobi rotations. Divide and conquer (BDCSVD) of Eigen 3.4 gives wrong vectors for three in a hundred roots of
// stiffness, which ones hangs on the compiler's flags: tests/linalg/rank_test.
namespace fork1s {

VectorX SingularValues(const MatrixX& A) {
  if (A.size() == 0) return VectorX(0);
  return Eigen::JacobiSVD<MatrixX>(A).singularValues();
}

SingularSpectrum LeftSingular(const MatrixX& A) {
  if (A.size() == 0) return {VectorX(0), MatrixX(A.rows(), 0)};
  const Eigen::JacobiSVD<MatrixX> svd(A, Eigen::ComputeThinU);
  return {svd.singularValues(), svd.matrixU()};
}

SingularSpectrum RightSingular(const MatrixX& A) {
  if (A.size() == 0) return {VectorX(0), MatrixX::Identity(A.cols(), A.cols())};
  const Eigen::JacobiSVD<MatrixX> svd(A, Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixV()};
}

}  // namespace fork1s
