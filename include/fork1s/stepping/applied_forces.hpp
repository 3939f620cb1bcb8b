// Forces that are constant in world axes at points fixed in a body.
#pragma once

#include <fork1s/spatial/rigid_transform.hpp>

namespace fork1s {

/// Forces F_i in world axes at points p_i of a body, and a pure moment in world axes. At any orientation R of
/// the body their moment follows from N = Σ p_i F_iᵀ alone, so that any number of forces takes the same
/// space:
///     Σ (R p_i) × F_i = axial(R N),   axial(G) = [G₂₃ - G₃₂; G₃₁ - G₁₃; G₁₂ - G₂₁]
struct AppliedForces {
  Vector3 force_W = Vector3::Zero();        // N, Σ F_i
  Vector3 moment_W = Vector3::Zero();       // N·m, of the pure moments
  Matrix3 force_moments = Matrix3::Zero();  // N·m, N: rows in body axes, columns in world axes

  /// `arm_B` [m]: from the point that moments are taken about to the force.
  void Add(const Vector3& of_force_W, const Vector3& of_moment_W, const Vector3& arm_B) {
    force_W += of_force_W;
    moment_W += of_moment_W;
    force_moments += arm_B * of_force_W.transpose();
  }
  bool IsZero() const { return force_W.isZero(0) && moment_W.isZero(0) && force_moments.isZero(0); }
  /// Moment [N·m] in world axes at the orientation R_WB.
  Vector3 MomentAt(const Matrix3& R_WB) const { return moment_W + Axial(R_WB * force_moments); }

  /// Σ r_i × F_i of G = Σ r_i F_iᵀ.
  static Vector3 Axial(const Matrix3& G) { return {G(1, 2) - G(2, 1), G(2, 0) - G(0, 2), G(0, 1) - G(1, 0)}; }
  /// Σ (θ × r_i) × F_i = TurnedLever(G) θ.
  static Matrix3 TurnedLever(const Matrix3& G) { return G - G.trace() * Matrix3::Identity(); }
};

}  // namespace fork1s
