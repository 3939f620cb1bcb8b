// The compliance that interface bodies feel, by two methods.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/reduction/rank_doubt.hpp>
#include <vector>

namespace fork1s {

/// Compliance of e interface bodies at one pose, with the base held. Displacements are
/// [rotation; translation of the body's origin] per body, loads [moment about that origin; force], world axes.
struct InterfaceCompliance {
  /// 6e x 6e, displacement = C load, for loads that do no work on the free directions. If there are any, C
  /// is neither the compliance of the free bodies, which is unbounded, nor that of locked ones
  /// (ComputeCompliance): both sides are projected onto the complement of the free directions (rotations scaled by
  /// the length of the mechanism), so that it does not depend on the position along them.
  MatrixX C;
  /// 6e x f: basis of the spring-free motions of the bodies; f = 0 if springs resist all motions.
  MatrixX free;
  /// Independent elastic motions that the bodies can make: the rank of C.
  int rank = 0;
  /// Joint coordinates that were locked.
  std::vector<int> locked;
  /// Rank decisions that rounding or the digits of the file could change.
  std::vector<RankDoubt> doubts;
};

/// If a spring-free motion moves one of the bodies, so that a load on it meets no resistance, the compliance is
/// refused, or the motion is locked.
enum class OnFreeMotion { kRefuse, kLock };

/// Joint coordinates, one for each spring-free motion that moves one of the bodies, which hold all of these
/// motions while they are locked; empty where springs hold the bodies. With kRefuse an error instead
/// (kUnderdetermined), which names the body, the joints and the remedy.
Expected<std::vector<int>> CoordinatesToLock(const Mechanism& mechanism, const VectorX& q,
                                             const std::vector<BodyIndex>& bodies, OnFreeMotion on_free);

/// The compliance to report, with coordinates locked if spring-free motions move the bodies.
/// Errors as of CoordinatesToLock.
Expected<InterfaceCompliance> ComputeCompliance(const Mechanism& mechanism, const VectorX& q,
                                                const std::vector<BodyIndex>& bodies, OnFreeMotion on_free);

/// Compliance of the mechanism with the coordinates in `locked` held at q, which removes the spring-free motions that
/// they are part of. The joint displacements q must close the loops. By an incremental walk over the body graph
/// (docs/method.md, section 3): every joint on the paths of two bodies adds S k⁻¹ Sᵀ, loops and unsprung
/// joints then condition the result.
InterfaceCompliance WalkCompliance(const Mechanism& mechanism, const VectorX& q,
                                   const std::vector<BodyIndex>& bodies, const std::vector<int>& locked = {});

/// The same from the dense elastic basis: C = J V Vᵀ Jᵀ, with locked coordinates J Π V (J Π V)ᵀ, where Π adds the
/// spring-free motions that cancel the displacement of the locked coordinates.
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

/// Inverse of a compliance (6e x 6e); empty if its rank is less than 6e.
MatrixX StiffnessFromCompliance(const InterfaceCompliance& compliance, double length);

}  // namespace fork1s
