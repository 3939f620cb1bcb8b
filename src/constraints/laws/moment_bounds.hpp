// Torsional and rolling friction: moments of a contact within bounds that follow its normal impulse.
//
//     m_k = clamp(y_k, −r_k λ_n, r_k λ_n),   k: about the normal, tangent 1, tangent 2
// with radii r [m] (M. Ciocarlie, C. Lackner and P. Allen, World Haptics 2007; one bound an axis, as MuJoCo's
// pyramid, instead of an ellipsoid).
#pragma once

#include <fork1s/base/types.hpp>

#include "bounds.hpp"

namespace fork1s::internal {

struct MomentBounds {
  Vector3 radius = Vector3::Zero();  // m; 0: no moment about that axis
  Vector3 R = Vector3::Zero();       // rad/s per N·m·s
  double share = 1;                  // of the radii that counts

  bool Has(int axis) const { return radius[axis] > 0; }
  bool Any() const { return Has(0) || Has(1) || Has(2); }
  /// The law about one axis under a normal impulse.
  BoundLaw At(int axis, double normal) const {
    const double bound = share * radius[axis] * normal;
    return {R[axis], -bound, bound};
  }
  /// ∂m/∂λ_n of a moment at its bound.
  double ByNormal(int axis, double y) const { return share * (y > 0 ? radius[axis] : -radius[axis]); }
  /// ∂m/∂share of a moment at its bound.
  double ByShare(int axis, double y, double normal) const {
    return (y > 0 ? radius[axis] : -radius[axis]) * normal;
  }
};

}  // namespace fork1s::internal
