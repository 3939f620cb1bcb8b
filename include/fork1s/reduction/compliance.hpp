// The compliance that interface bodies feel, by two roads.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/reduction/rank_doubt.hpp>
#include <vector>

namespace fork1s {

/// What e interface bodies feel of a mechanism's springs at one pose, with the base held. Displacements are
/// [rotation; translation of the body's origin] per body, loads [moment about that origin; force], world axes.
struct InterfaceCompliance {
  /// 6e x 6e, displacement = C load, for loads that do no work on the free directions. Where there are any, C
  /// is projected off them on both sides (turns measured in lengths of the mechanism), so that it does not
  /// depend on how far the bodies have drifted along them.
  MatrixX C;
  /// 6e x f: motions of the bodies that no spring resists, independent; f = 0 where springs hold them all.
  MatrixX free;
  /// Independent elastic motions that the bodies can make: the rank of C.
  int rank = 0;
  /// Rank decisions on the way that rounding or the digits of the file might turn round.
  std::vector<RankDoubt> doubts;
};

/// At joint displacements q, which must close the loops. By walking the body graph (docs/method.md, section
/// 3): every joint on the paths of two bodies adds S k⁻¹ Sᵀ, loops and unsprung joints then condition the
/// result.
InterfaceCompliance WalkCompliance(const Mechanism& mechanism, const VectorX& q,
                                   const std::vector<BodyIndex>& bodies);

/// The same from the dense elastic basis: C = J V Vᵀ Jᵀ.
InterfaceCompliance DenseCompliance(const Mechanism& mechanism, const VectorX& q,
                                    const std::vector<BodyIndex>& bodies);

/// How the bodies move, as rows of C, per force along each joint coordinate: Y, 6e x n, projected as C is. A
/// spring of stiffness k on the length tᵀq gives ∂C/∂k = -(Y t)(Y t)ᵀ; for the spring of joint j that is
/// -y_j y_jᵀ, y_j the j-th column.
MatrixX InterfaceResponse(const Mechanism& mechanism, const VectorX& q, const std::vector<BodyIndex>& bodies);

/// Largest difference of two compliances of the same bodies, relative to the largest entry of either, turns
/// measured in `length`; infinity where they have different ranks or numbers of free directions.
double ComplianceDifference(const InterfaceCompliance& a, const InterfaceCompliance& b, double length);

/// Inverse of a compliance where it exists (6e x 6e): empty where the bodies cannot be pushed elastically in
/// every way.
MatrixX StiffnessFromCompliance(const InterfaceCompliance& compliance, double length);

}  // namespace fork1s
