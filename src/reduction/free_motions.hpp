// Spring-free motions of interface bodies, and what is left of displacements without them.
#pragma once

#include <fork1s/reduction/compliance.hpp>

namespace fork1s::internal {

/// Displacements of interface bodies in lengths of the mechanism: [turn; displacement / L] per body.
struct FreeMotions {
  MatrixX basis;  ///< 6e x f, orthonormal

  /// Rows less their part along the free motions.
  MatrixX Without(const MatrixX& displacements) const {
    if (basis.cols() == 0) return displacements;
    return displacements - basis * (basis.transpose() * displacements);
  }
};

/// `moved` (6e x k): how k spring-free motions of joints, orthonormal in one unit, move the bodies.
FreeMotions FreeMotionsOf(const MatrixX& moved);

/// Multiplies rows of displacements [turn; displacement] by [turn; 1/L displacement], or back.
MatrixX InLengths(const MatrixX& displacements, double length);
MatrixX FromLengths(const MatrixX& displacements, double length);

/// C, free motions and rank in world axes from their root: C = root rootᵀ (6e x any, in lengths, root axes).
/// `motions`: what the bodies can do at all, in one unit.
InterfaceCompliance Assemble(const Mechanism& mechanism, const MatrixX& root, const FreeMotions& free,
                             const MatrixX& motions);

/// P C P in world axes, for C of displacements [turn; displacement] in root axes and P the projector off the
/// free motions.
MatrixX WithoutFree(const Mechanism& mechanism, const MatrixX& C, const FreeMotions& free);

}  // namespace fork1s::internal
