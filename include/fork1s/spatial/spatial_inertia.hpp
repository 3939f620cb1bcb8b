// Mass, centre of mass and rotational inertia of a rigid body.
#pragma once

#include <fork1s/spatial/rigid_transform.hpp>

namespace fork1s {

/// Inertia of a rigid body B in its own frame: mass [kg], centre of mass p_BC [m], and rotational
/// inertia about the centre of mass in the axes of B [kg·m²].
struct SpatialInertia {
  double mass = 0;
  Vector3 center = Vector3::Zero();
  Matrix3 rotational = Matrix3::Zero();

  /// 6x6 about the origin of B: [I_C - m [c][c], m [c]; -m [c], m 1], angular first.
  Matrix6 Matrix() const;
};

/// The same inertia seen from frame A, for X_AB.
SpatialInertia Transform(const RigidTransform& X, const SpatialInertia& I);

/// Angular rate in a body's own axes after it turned freely for a time t [s] under a constant torque in those
/// axes [N·m], from omega_B [rad/s]; I about the centre. Without torque kinetic energy stays to rounding and
/// angular momentum to second order (implicit midpoint).
Vector3 TurnFreely(const Matrix3& I, const Vector3& omega_B, const Vector3& torque_B, double t);

}  // namespace fork1s
