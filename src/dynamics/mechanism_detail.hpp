// The parts of a mechanism's step, by the files that have them.
#pragma once

#include <cmath>
#include <fork1s/dynamics/mechanism_model.hpp>
#include <fork1s/dynamics/mechanism_step.hpp>

#include "mechanism_workspace.hpp"

namespace fork1s {

// Workspace and pose (mechanism_pose.cpp).
/// What a new reference makes of loops and of coordinates without a load.
void StartAtReference(const MechanismModel& model, MechanismState& state);
/// The workspace, that of another model so far.
void Renew(const MechanismStep& here);
void Size(const MechanismStep& here);
void UpdateConfiguration(const MechanismStep& here, bool loops_are_closed = false);  // by the µ at hand
void UpdateMassMatrix(const MechanismStep& here);  // inertia, by the Jacobians at hand
void UpdatePose(const MechanismStep& here, bool loops_are_closed = false);  // configuration and Jacobians

// A stage (implicit_stage.cpp).
void PredictLinearMomentum(const MechanismStep& here, double time, const Vector3& linear_W);
void ForgetInputs(const MechanismStep& here);
/// x <- A⁻¹ x. An A that is no inertia gives no number, which World::Step finds, takes back and reports.
void SolveOrFail(Cholesky& factor, const MatrixX& A, VectorX& x);

/// √s of a square s that rounding may have made negative; NaN for NaN, which std::max would turn into 0.
inline double RootOf(double s) { return s < 0 ? 0 : std::sqrt(s); }

// The matrix of a stage (stage_matrix.cpp).
/// A and its factor for a stage of length b [s] at the pose at hand: anew where the length or saturation
/// differ, else what of its stiffness changes with the pose.
void UpdateStageMatrix(const MechanismStep& here, double b);

// Forces (mechanism_forces.cpp).
inline bool HasForcesFromOutside(const MechanismState& state) {
  return state.has_loads || state.point_spring.IsActive();
}
void TakeReferenceForces(MechanismModel& model);
void LoadForces(const MechanismStep& here, const Vector3& gravity_R);

// Loads (applied_forces.cpp).
/// F += wrenches of loads and of the point spring without its damper, as AddLoadWrenches.
void AddAppliedWrenches(const MechanismView& here, Matrix6X& F);
/// K_loads <- geometric stiffness of the loads and of the point spring at the pose at hand.
void ComputeLoadStiffness(const MechanismStep& here);
/// A += b² times the geometric stiffness, as of loads, of weight and of the forces (p̂ - p)/b that change the
/// momenta of the parts within b at the pose and velocity at hand: light links that a heavy body stretches.
void AddInertialStiffness(const MechanismStep& here, double b);

// A point spring (point_spring.cpp).
/// At the pose at hand: its Jacobian; f_z and base_force += its force without the damper.
void EvaluatePointSpring(const MechanismStep& here);
/// Force in R [N] with the damper, at the velocity that led to the pose at hand.
Vector3 PointSpringForce(const MechanismView& here);
/// A, stage_rhs += its stiffness and damping in a stage of length b [s], but for the geometric stiffness.
void AddPointSpringOperator(const MechanismStep& here, double b);

/// Of the present pose and controls.
ReductionLoads LoadsOf(const MechanismOptions& options, const MechanismState& state,
                       const Matrix6X& wrenches_R, const VectorX& control_change);

// Parts that move independently (mechanism_ports.cpp).
void FindParts(MechanismModel& model);
/// Factors of the workspace know them.
void DivideIntoParts(const MechanismStep& here);

// Springs and dampers along lengths (lengths.cpp).
/// out = Qᵀ ∂ℓ/∂q
void ReducedRow(const Mechanism::Length& length, const std::vector<PathState>& paths, const RowMatrixX& Q,
                VectorX& out);
void AddSpringOf(const MechanismStep& here, const Mechanism::Length& length, double weight, bool bends);
/// A += weight times the stiffness of springs of paths, and of those that are not linear, at the pose beyond that in K_r.
void AddNonlinearStiffness(const MechanismStep& here, double weight);
void FindDampers(MechanismModel& model);
/// D += weight Σ (E Q_θ)ᵀ d (E Q_θ) over rotations with dampers, at the pose of `kinematics` and Q, in the lower triangle.
/// `rows`: scratch; no allocation where it has its size.
void AddRotationDamping(const MechanismModel& model, const Kinematics& kinematics, const RowMatrixX& Q, double weight,
                        RowMatrixX& rows, Eigen::Ref<MatrixX> D);
bool DampersTurn(const MechanismModel& model);
/// tau [n] -= b times the forces of dampers along lengths at joint rates q_dot [n].
void AddSpringDampers(const MechanismStep& here, double b, const VectorX& q_dot, VectorX& tau);
void AddDampersBeyond(const MechanismStep& here, double weight, bool bent, const VectorX& w,
                      Eigen::Ref<MatrixX> D);

// Bounds of forces (force_limits.cpp).
double UnboundedForce(const MechanismView& here, const Mechanism::ForceLimit& limit);
void SizeForceLimits(const MechanismStep& here);
void OpenSwitches(const MechanismStep& here);
void OpenForceLimits(const MechanismStep& here);
bool UpdateForceLimits(const MechanismStep& here, double h);
bool ServosTurn(const MechanismView& here);
void TurnServos(const MechanismStep& here, double h);
void SubtractSaturatedStiffness(const MechanismStep& here, double h);
void AddSwitchedForces(const MechanismStep& here);
/// In a stage: rhs [num_velocities] without the dampers of servos at their bounds, at the velocity that led
/// to the pose.
void AddBackSaturatedDampers(const MechanismStep& here, double b, VectorX& rhs);
double WayToForce(const MechanismStep& here, const Mechanism::Length& length, double h);
double EnergyBeyondBounds(const MechanismView& here);

// Springs that are slack over a range (slack.cpp).
void FindSlackSprings(const MechanismStep& here);
void OpenSlackSprings(const MechanismStep& here);
double SlackStiffness(const MechanismModel& model, const SlackSpring& slack);
void AddSlackForces(const MechanismStep& here);
bool UpdateSlackSprings(const MechanismStep& here, double h);
BoundedForceRow RowOfSlack(const MechanismStep& here, const SlackSpring& slack, int end, double h);
/// At the end of a stage of length b [s] that was solved [N or N·m].
double ForceOfSlack(const MechanismStep& here, const SlackSpring& slack, double b);

}  // namespace fork1s
