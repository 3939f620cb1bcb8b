// Closed, spring-free and elastic coordinates of a mechanism at one pose.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>

namespace fork1s::internal {

/// Columns of Z span null(A); within them N (no spring) and V with Vᵀ K V = 1.
/// On trees whose springs act on single joints everything is diagonal and nothing dense is formed:
/// V = diag(scale) on the sprung coordinates, N = unit vectors of the others.
struct ElasticBasis {
  bool diagonal = false;
  // diagonal form
  std::vector<int> sprung, unsprung;  // coordinates
  VectorX inverse_root;               // k^{-1/2} of the sprung ones
  // dense form (n rows)
  MatrixX Z, N, V;
  std::vector<int> independent_rows;  // of the closure Jacobian

  int num_free() const { return diagonal ? static_cast<int>(unsprung.size()) : static_cast<int>(N.cols()); }
  int num_elastic() const { return diagonal ? static_cast<int>(sprung.size()) : static_cast<int>(V.cols()); }
  /// Dense n x num_free and n x num_elastic.
  MatrixX DenseFree(int n) const;
  MatrixX DenseElastic(int n) const;
  /// V y and Vᵀ g without forming V.
  VectorX ApplyV(const VectorX& y, int n) const;
  VectorX ApplyVTransposed(const VectorX& g) const;
  /// B V for a matrix B with n columns.
  MatrixX TimesV(const MatrixX& B) const;
};

ElasticBasis ComputeElasticBasis(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q);

/// Stacked Jacobians of the bodies (6e x n), rows about each body's origin; rotation rows times `length`.
MatrixX ScaledInterfaceJacobian(const Mechanism& mechanism, const Kinematics& kinematics,
                                const std::vector<BodyIndex>& bodies, double length);

/// Coordinate scale: 1 for turning freedoms, the mechanism's length for sliding ones.
VectorX CoordinateScale(const Mechanism& mechanism);

/// Y (e x f): independent directions of free motion that J does not see, empty if all are seen.
MatrixX HiddenDirections(const MatrixX& J_N);

}  // namespace fork1s::internal
