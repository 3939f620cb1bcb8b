// Where a mechanism comes to rest under dead loads, and its compliance, by either simulator.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <optional>
#include <string>
#include <vector>

namespace fork1s::internal {

/// A force of fixed direction at the origin of a body, world axes, or gravity, or both.
struct RestLoad {
  std::optional<std::string> body;
  Vector3 force_W = Vector3::Zero();    // N
  Vector3 gravity_W = Vector3::Zero();  // m/s²
};

/// World poses of all bodies at rest, base held. Errors: kNumerics where it does not come to rest.
///
/// Full: one step of implicit Euler so long that inertia and damping vanish beside the springs is the
/// equilibrium itself, since the full simulator solves the step as it is. A dead force is the weight of a
/// mass at the body's origin.
Expected<std::vector<RigidTransform>> RestOfFull(const MechanismDef& definition, const RestLoad& load);
/// Reduced: steps under the load until nothing moves, with dampers that bring it to rest soon.
Expected<std::vector<RigidTransform>> RestOfReduced(const MechanismDef& definition, const RestLoad& load);

/// Compliance of the definition's interface bodies at the reference, base held, as in WalkCompliance.
/// Full: central differences of small loads and of the poses at which they come to rest; `step` [rad and m]
/// is the size of these displacements, `scale` an estimate of the compliance that sets the loads.
Expected<MatrixX> ComplianceOfFull(const MechanismDef& definition, const MatrixX& scale, double step = 3e-5);
/// Reduced: T_E K_r⁻¹ T_Eᵀ of the elastic coordinates. kUnderdetermined where a spring-free one moves a body.
Expected<MatrixX> ComplianceOfReduced(const ReducedModel& model);

}  // namespace fork1s::internal
