#include <fork1s/linalg/solve.hpp>

#include <Eigen/LU>
#include <Eigen/QR>

namespace fork1s {

MatrixX SolveSquare(const MatrixX& A, const MatrixX& B) {
  if (A.size() == 0) return MatrixX(0, B.cols());
  return Eigen::PartialPivLU<MatrixX>(A).solve(B);
}

Eigen::MatrixXcd SolveComplex(const Eigen::MatrixXcd& A, const Eigen::MatrixXcd& B) {
  if (A.size() == 0) return Eigen::MatrixXcd(0, B.cols());
  return Eigen::PartialPivLU<Eigen::MatrixXcd>(A).solve(B);
}

MatrixX LeastNormSolve(const MatrixX& A, const MatrixX& B, double threshold) {
  if (A.size() == 0) return MatrixX::Zero(A.cols(), B.cols());
  Eigen::CompleteOrthogonalDecomposition<MatrixX> decomposition;
  decomposition.setThreshold(threshold);
  decomposition.compute(A);
  return decomposition.solve(B);
}

}  // namespace fork1s
