// How a point of a body answers a force in the next step.
#pragma once

#include <fork1s/stepping/free_body.hpp>

#include "stepping/step_context.hpp"

namespace fork1s {

/// How a point fixed to a body gives way in a stage of h [s], without contact; world axes.
struct PointResponse {
  Matrix3 W = Matrix3::Zero();  // m/s per N·s: J A⁻¹ Jᵀ, A the matrix of the stage at the present pose
  double mass = 0;              // kg, of all that hangs on it
};
PointResponse RespondAt(const ConstStepContext& here, BodyIndex body, const Vector3& point_B, double h);
PointResponse RespondAt(const FreeBody& body, const Vector3& point_B);

/// Damping [N s/m] that is critical for what the point moves along its softest direction, never for more than
/// the whole mass.
double CriticalDamping(const PointResponse& at, double stiffness);

}  // namespace fork1s
