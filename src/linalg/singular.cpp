#include "linalg/spectrum.hpp"

#include <Eigen/SVD>

// By Jacobi rotations. Divide and conquer (BDCSVD) of Eigen 3.4 gives wrong vectors for three in a hundred roots of
// stiffness, which ones hangs on the compiler's flags: tests/linalg/rank_test.
namespace fork1s {
namespace {

// For a matrix that is not square, Eigen 3.4 destroys a part of the decomposition before it has memory for
// the next. Where there is none the decomposition must not be destroyed once more, so then it is left where
// it is.
class JacobiSvd {
 public:
  JacobiSvd(const MatrixX& A, unsigned options) : svd_(new Eigen::JacobiSVD<MatrixX>()) {
    svd_->compute(A, options);
  }
  ~JacobiSvd() { delete svd_; }
  JacobiSvd(const JacobiSvd&) = delete;
  JacobiSvd& operator=(const JacobiSvd&) = delete;
  const Eigen::JacobiSVD<MatrixX>* operator->() const { return svd_; }

 private:
  Eigen::JacobiSVD<MatrixX>* svd_;  // no smart pointer: a constructor that throws shall not delete it
};

}  // namespace

VectorX SingularValues(const MatrixX& A) {
  if (A.size() == 0) return VectorX(0);
  return JacobiSvd(A, 0)->singularValues();
}

SingularSpectrum LeftSingular(const MatrixX& A) {
  if (A.size() == 0) return {VectorX(0), MatrixX(A.rows(), 0)};
  const JacobiSvd svd(A, Eigen::ComputeThinU);
  return {svd->singularValues(), svd->matrixU()};
}

SingularSpectrum RightSingular(const MatrixX& A) {
  if (A.size() == 0) return {VectorX(0), MatrixX::Identity(A.cols(), A.cols())};
  const JacobiSvd svd(A, Eigen::ComputeFullV);
  return {svd->singularValues(), svd->matrixV()};
}

}  // namespace fork1s
