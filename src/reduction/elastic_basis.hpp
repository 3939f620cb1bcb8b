// Closed, spring-free and elastic coordinates of a mechanism at one pose.
#pragma once

#include <fork1s/reduction/rank_doubt.hpp>
#include <fork1s/reduction/reduced_model.hpp>

#include "mechanism/coordinate_scaling.hpp"

namespace fork1s::internal {

/// Columns of Z span null(A); within them N (no spring) and V with Vᵀ K V = 1.
/// On trees whose springs act on single joints everything is diagonal and nothing dense is formed:
/// V = diag(scale) on the sprung coordinates, N = unit vectors of the others.
///
/// What is free and what is elastic is geometry: which motions stretch springs, whatever their stiffness.
///
/// Every column is of one group of coordinates that depend on each other, and the columns of a group stand
/// together.
struct ElasticBasis {
  struct Part {
    int free = 0, num_free = 0, elastic = 0, num_elastic = 0;  // columns of N and of V
  };
  bool diagonal = false;
  std::vector<Part> parts;
  VectorX scale;  // n: q = scale ∘ x, x in one unit
  // diagonal form
  std::vector<int> sprung, unsprung;  // coordinates
  VectorX inverse_root;               // k^{-1/2} of the sprung ones
  // dense form (n rows); Z and N orthonormal in x; Z empty where it was not asked for
  MatrixX Z, N, V;
  MatrixX elastic_x;                  // n x elastic: what V spans in columns of length 1 in x, springs aside
  std::vector<int> independent_rows;  // of the closure Jacobian
  std::vector<RankDoubt> doubts;

  int num_free() const { return diagonal ? static_cast<int>(unsprung.size()) : static_cast<int>(N.cols()); }
  int num_elastic() const { return diagonal ? static_cast<int>(sprung.size()) : static_cast<int>(V.cols()); }
  /// The same with the elastic columns of one part alone.
  ElasticBasis ElasticOf(const Part& part) const;
  /// The part of an elastic or of a free column.
  int PartOfElastic(Eigen::Index column) const;
  int PartOfFree(Eigen::Index column) const;
  /// Dense n x num_free.
  MatrixX DenseFree(int n) const;
  /// The free motions as x, orthonormal: n x num_free.
  MatrixX ScaledFreeDirections(int n) const;
  /// Whether bodies with rows J_x (in one unit, on x) move in any elastic direction by more than rounding.
  bool HasElasticMotion(const MatrixX& J_x) const;
  /// All closed motions, n x num_closed.
  MatrixX DenseClosed(int n) const;
  /// V y and Vᵀ g without forming V.
  VectorX ApplyV(const VectorX& y, int n) const;
  VectorX ApplyVTransposed(const VectorX& g) const;
  /// |V|ᵀ g.
  VectorX ApplyAbsVTransposed(const VectorX& g) const;
  /// B V for a matrix B with n columns.
  MatrixX TimesV(const MatrixX& B) const;
};

/// How V is found. kCareful: orthogonally throughout, with Z. kQuick: by elimination where every rank is
/// clear, which costs a quarter, without Z, and as kCareful elsewhere; V then spans the same in other
/// columns.
enum class BasisBy { kCareful, kQuick };

ElasticBasis ComputeElasticBasis(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                                 BasisBy by = BasisBy::kCareful);

/// Motions that keep the loops closed: Z alone, n columns less the rank of the loops, orthonormal in one unit.
MatrixX ClosedMotions(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q);

/// Stacked Jacobians of the bodies (6e x n), rows about each body's origin; rotation rows times `length`.
MatrixX ScaledInterfaceJacobian(const Mechanism& mechanism, const Kinematics& kinematics,
                                const std::vector<BodyIndex>& bodies, double length);

/// What a doubtful decision was about: the joints that move most in `direction` (n, in one unit).
RankDoubt Doubt(const Mechanism& mechanism, const char* what, double kept, double dropped,
                const VectorX& direction);

}  // namespace fork1s::internal
