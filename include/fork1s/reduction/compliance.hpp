// The compliance that interface bodies feel, by two methods.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/reduction/rank_doubt.hpp>
#include <vector>

namespace fork1s {

/// What e interface bodies feel of a mechanism's springs at one pose, with the base held. Displacements are
/// [rotation; translation of the body's origin] per body, loads [moment about that origin; force], world axes.
struct InterfaceCompliance {
  /// 6e x 6e, displacement = C load, for loads that do no work on the free directions. Where there are any, C
  /// is neither the compliance of the free bodies, which has no bound, nor that of locked ones
  /// (ComputeCompliance): it is projected off them on both sides (turns measured in lengths of the
  /// mechanism), so that it does not depend on how far the bodies have drifted along them.
  MatrixX C;
  /// 6e x f: motions of the bodies that no spring resists, independent; f = 0 where springs hold them all.
  MatrixX free;
  /// Independent elastic motions that the bodies can make: the rank of C.
  int rank = 0;
  /// Joint coordinates that were held at their place.
  std::vector<int> locked;
  /// Rank decisions on the way that rounding or the digits of the file might turn round.
  std::vector<RankDoubt> doubts;
};

/// What becomes of a compliance where a spring-free motion moves one of the bodies, so that a load on it
/// meets no resistance: it is refused, or the motion is locked.
enum class OnFreeMotion { kRefuse, kLock };

/// Joint coordinates, one for each spring-free motion that moves one of the bodies, which hold all of these
/// motions while they are locked; empty where springs hold the bodies. With kRefuse an error instead
/// (kUnderdetermined), which names the body, the joints and the remedy.
Expected<std::vector<int>> CoordinatesToLock(const Mechanism& mechanism, const VectorX& q,
                                             const std::vector<BodyIndex>& bodies, OnFreeMotion on_free);

/// The compliance to report: that of bodies which springs hold, or with coordinates locked until they do.
/// Errors as of CoordinatesToLock.
Expected<InterfaceCompliance> ComputeCompliance(const Mechanism& mechanism, const VectorX& q,
                                                const std::vector<BodyIndex>& bodies, OnFreeMotion on_free);

/// Of the mechanism with the coordinates in `locked` held at q, which takes the spring-free motions that they
/// are part of from it. At joint displacements q, which must close the loops. By walking the body graph
/// (docs/method.md, section 3): every joint on the paths of two bodies adds S k⁻¹ Sᵀ, loops and unsprung
/// joints then condition the result.
InterfaceCompliance WalkCompliance(const Mechanism& mechanism, const VectorX& q,
                                   const std::vector<BodyIndex>& bodies, const std::vector<int>& locked = {});

/// The same from the dense elastic basis: C = J V Vᵀ Jᵀ, with locked coordinates J Π V (J Π V)ᵀ, where Π
/// takes out of a motion the spring-free ones that hold the coordinates still.
InterfaceCompliance DenseCompliance(const Mechanism& mechanism, const VectorX& q,
                                    const std::vector<BodyIndex>& bodies,
                                    const std::vector<int>& locked = {});

/// How the bodies move, as rows of C, per force along each joint coordinate: Y, 6e x n, projected as C is. A
/// spring of stiffness k on the length tᵀq gives ∂C/∂k = -(Y t)(Y t)ᵀ; for the spring of joint j that is
/// -y_j y_jᵀ, y_j the j-th column.
MatrixX InterfaceResponse(const Mechanism& mechanism, const VectorX& q, const std::vector<BodyIndex>& bodies,
                          const std::vector<int>& locked = {});

/// Largest difference of two compliances of the same bodies, relative to the largest entry of either, turns
/// measured in `length`; infinity where they have different ranks or numbers of free directions.
double ComplianceDifference(const InterfaceCompliance& a, const InterfaceCompliance& b, double length);

/// Inverse of a compliance where it exists (6e x 6e): empty where the bodies cannot be pushed elastically in
/// every way.
MatrixX StiffnessFromCompliance(const InterfaceCompliance& compliance, double length);

}  // namespace fork1s
