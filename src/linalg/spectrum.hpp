// Eigenvalues and singular values.
#pragma once

#include <fork1s/base/types.hpp>
#include <functional>

namespace fork1s {

/// A = vectors diag(values) vectorsᵀ, values ascending.
struct SymmetricSpectrum {
  VectorX values;
  MatrixX vectors;
};
SymmetricSpectrum SpectrumOf(const MatrixX& symmetric);
/// Ascending.
VectorX EigenvaluesOf(const MatrixX& symmetric);
Vector3 PrincipalValues(const Matrix3& symmetric);
/// The nearest matrix without negative eigenvalues.
Matrix3 PositivePart(const Matrix3& symmetric);
/// Eigenvalues of K v = µ M v for symmetric K and positive definite M, ascending; not numbers where M
/// is not positive definite.
VectorX EigenvaluesOf(const MatrixX& K, const MatrixX& M);

/// A v = value v for any square A, in no order.
struct GeneralSpectrum {
  Eigen::VectorXcd values;
  Eigen::MatrixXcd vectors;
};
GeneralSpectrum GeneralSpectrumOf(const MatrixX& A);

/// Largest `count` eigenpairs, descending, of a symmetric operator y = A x on n numbers, by Lanczos; n large
/// beside count. False where it did not converge.
bool LargestEigenpairs(const std::function<void(const double* x, double* y)>& apply, int n, int count,
                       VectorX& values, MatrixX& vectors);

/// Descending.
VectorX SingularValues(const MatrixX& A);
/// A = left diag(values) rightᵀ, values descending.
struct SingularSpectrum {
  VectorX values;  ///< min(m, n)
  MatrixX vectors;
};
/// With the first min(m, n) left vectors: m x min(m, n).
SingularSpectrum LeftSingular(const MatrixX& A);
/// With all right vectors: n x n; those past the values span what A does not see.
SingularSpectrum RightSingular(const MatrixX& A);

}  // namespace fork1s
