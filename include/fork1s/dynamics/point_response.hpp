// How a point of a body answers a force in the next step.
#pragma once

#include <fork1s/dynamics/free_body.hpp>
#include <fork1s/dynamics/mechanism_step.hpp>
#include <fork1s/dynamics/point_spring.hpp>

namespace fork1s {

/// Where the next step would carry the point without contact, and how it gives way; world axes.
struct PointResponse {
  Vector3 p_free = Vector3::Zero();  // m
  Vector3 v_free = Vector3::Zero();  // m/s
  Matrix3 W = Matrix3::Zero();       // m/s per N·s
  Matrix3 C = Matrix3::Zero();       // m per N, at once
  double mass = 0;                   // kg, of all that hangs on it
};

/// Of a point fixed to a body, in a step of implicit Euler of h [s]. A copy of the state takes that step in
/// a workspace of its own.
PointResponse RespondAt(const MechanismView& here, BodyIndex body, const Vector3& point_B, double h,
                        const Vector3& gravity_W);
PointResponse RespondAt(FreeBody body, const Vector3& point_B, double h, const Vector3& gravity_W);

/// Force [N] of a spring at the end of that step, F = k (target - x⁺) - c ẋ⁺ with x⁺ = p_free + (h² W + C) F
/// and ẋ⁺ = v_free + h W F, so that no stiffness makes a light fingertip ring. Contact is left to the step
/// itself.
Vector3 EndForce(const PointResponse& at, const PointSpring& spring, double h);
/// Damping [N s/m] that is critical for what the point moves along its softest direction, never for more than
/// the whole mass.
double CriticalDamping(const PointResponse& at, double stiffness);

}  // namespace fork1s
