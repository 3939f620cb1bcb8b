// The parts of a mechanism's step, by the files that have them.
#pragma once

#include <cmath>
#include <fork1s/dynamics/mechanism_model.hpp>
#include <fork1s/dynamics/mechanism_step.hpp>

#include "mechanism_workspace.hpp"

namespace fork1s {

// Workspace and pose (mechanism_pose.cpp).
/// What a new reference makes of loops and of the interior's own displacement.
void StartAtReference(const MechanismModel& model, MechanismState& state);
/// The workspace, that of another model so far.
void Renew(const MechanismStep& here);
void Size(const MechanismStep& here);
void UpdateConfiguration(const MechanismStep& here, bool loops_are_closed = false);  // by the µ at hand
void UpdateInertia(const MechanismStep& here);                                       // Jacobians and inertia
void UpdateMassMatrix(const MechanismStep& here);  // inertia, by the Jacobians at hand
void UpdatePose(const MechanismStep& here, bool loops_are_closed = false);  // configuration and Jacobians
/// Twist in R [6] that takes a driven base to its next pose within h [s].
Vector6 DrivenTwist(const MechanismState& state, double h);

// Of any rule (mechanism_step.cpp).
void SolveFree(const MechanismStep& here, double h);
void ForgetInputs(const MechanismStep& here);
/// x <- A⁻¹ x. An A that is no inertia gives no number, which World::Step finds, takes back and reports.
void SolveOrFail(Cholesky& factor, const MatrixX& A, VectorX& x);

/// √s of a square s that rounding may have made negative; NaN for NaN, which std::max would turn into 0.
inline double RootOf(double s) { return s < 0 ? 0 : std::sqrt(s); }

// Forces (mechanism_forces.cpp).
void TakeReferenceForces(MechanismModel& model);
void LoadForces(const MechanismStep& here, const Vector3& gravity_R);
void LoadForcesTwist(const MechanismStep& here, const Vector3& gravity_R, const Vector6& A_R);

// Loads (applied_forces.cpp).
/// F += wrenches of loads and of the point spring without its damper, as AddLoadWrenches.
void AddAppliedWrenches(const MechanismView& here, Matrix6X& F);
/// K_loads <- geometric stiffness of the loads and of the point spring at the pose at hand.
void ComputeLoadStiffness(const MechanismStep& here);

// A point spring (point_spring.cpp).
/// At the pose at hand: its Jacobian; f_z and base_force += its force without the damper.
void EvaluatePointSpring(const MechanismStep& here);
/// Force in R [N] with the damper, at the velocity that led to the pose at hand.
Vector3 PointSpringForce(const MechanismView& here);
/// A, stage_rhs += its stiffness and damping in a stage of length b [s], but for the geometric stiffness.
void AddPointSpringOperator(const MechanismStep& here, double b);

/// Of the present pose and controls.
ReductionLoads LoadsOf(const MechanismOptions& options, const MechanismState& state,
                       const Matrix6X& wrenches_R);

// The interior (interior.cpp).
void FollowLoads(const MechanismStep& here);
double ShareThatLoadsAllow(const MechanismStep& here);
const VectorX& WrenchForces(const MechanismStep& here);
void ApplyStiffness(const MechanismModel& model, const VectorX& q, VectorX& force);

// By twists (twist_step.cpp).
void Factor(const MechanismStep& here, double h);
void PredictTwist(const MechanismStep& here, double h, const Vector3& gravity_W);
void SolveFreeTwist(const MechanismStep& here, double h);
void IntegrateTwist(const MechanismStep& here, double h);

// Parts that move independently (mechanism_ports.cpp).
void FindParts(MechanismModel& model);
/// Factors of the workspace know them.
void DivideIntoParts(const MechanismStep& here);

// Springs and dampers along lengths (lengths.cpp).
/// out = Qᵀ ∂ℓ/∂q
void ReducedRow(const Mechanism::Length& length, const std::vector<PathState>& paths, const RowMatrixX& Q,
                VectorX& out);
/// Modes are those of the reference's springs; only where all acts at the end are those of the pose as easily
/// taken.
bool ActsAtPose(const MechanismView& here);
bool TakesBentSprings(const MechanismView& here);
void AddSpringOf(const MechanismStep& here, const Mechanism::Length& length, double weight, bool bends);
void TurnSprings(const MechanismStep& here, double h);
/// A += weight times the stiffness of springs of paths, and of those that are not linear, at the pose beyond that in K_r.
void AddNonlinearStiffness(const MechanismStep& here, double weight);
void FindDampers(MechanismModel& model);
void TakeStiffnessBeyond(const MechanismStep& here);
/// D += weight Σ (E Q_θ)ᵀ d (E Q_θ) over rotations with dampers, at the pose of `kinematics` and Q, in the lower triangle.
/// `rows`: scratch; no allocation where it has its size.
void AddRotationDamping(const MechanismModel& model, const Kinematics& kinematics, const RowMatrixX& Q, double weight,
                        RowMatrixX& rows, Eigen::Ref<MatrixX> D);
bool DampersTurn(const MechanismModel& model);
/// tau [n] -= b times the forces of dampers along lengths at joint rates q_dot [n].
void AddSpringDampers(const MechanismStep& here, double b, const VectorX& q_dot, VectorX& tau);
void AddDampersBeyond(const MechanismStep& here, double weight, bool bent, const VectorX& w,
                      Eigen::Ref<MatrixX> D);
void TurnDampers(const MechanismStep& here, double h);

/// Of springs, weight and controls, servos without bounds [J], and the size of the terms that it is the sum of.
struct Potential {
  double energy = 0, size = 0;
};
/// Sums of a hundred such terms know no more digits than this.
constexpr double kPotentialRounding = 1e-13;

// Bounds of forces (force_limits.cpp).
double UnboundedForce(const MechanismView& here, const Mechanism::ForceLimit& limit);
void SizeForceLimits(const MechanismStep& here);
void OpenSwitches(const MechanismStep& here);
void OpenForceLimits(const MechanismStep& here);
bool UpdateForceLimits(const MechanismStep& here, double h);
bool AnyChangesSides(const MechanismStep& here, double h);
void AddBackBoundedSprings(const MechanismStep& here, double h, double damping,
                           const Eigen::Ref<const VectorX>& beside, Eigen::Ref<VectorX> rhs);
void RowOfSpring(const MechanismStep& here, const Mechanism::Length& length);
bool AnyAtBound(const MechanismState& state);
bool ServosTurn(const MechanismView& here);
void TurnServos(const MechanismStep& here, double h);
void SubtractSaturatedStiffness(const MechanismStep& here, double h);
void AddSwitchedForces(const MechanismStep& here);
/// In a stage: rhs [num_velocities] without the dampers of servos at their bounds, at the velocity that led
/// to the pose.
void AddBackSaturatedDampers(const MechanismStep& here, double b, VectorX& rhs);
bool IsCaught(const MechanismView& here, std::size_t force_limit);
double WorkOfCaught(const MechanismStep& here, double h, const Eigen::Ref<const VectorX>& w);
double WayToForce(const MechanismStep& here, const Mechanism::Length& length, double h);
void SpringPull(const MechanismStep& here, const VectorX& moved, VectorX& force);
double EnergyBeyondBounds(const MechanismView& here);
void KeepBoundedLengths(const MechanismStep& here);
double BeyondBoundsAtStart(const MechanismView& here);
Potential PotentialOfStep(const MechanismView& here, const RigidTransform& X_WR);

// Springs that are slack over a range (slack.cpp).
void FindSlackSprings(const MechanismStep& here);
void OpenSlackSprings(const MechanismStep& here);
double SlackStiffness(const MechanismModel& model, const SlackSpring& slack);
void AddSlackForces(const MechanismStep& here);
bool UpdateSlackSprings(const MechanismStep& here, double h);
/// At the end of a stage of length b [s] that was solved [N or N·m].
double ForceOfSlack(const MechanismStep& here, const SlackSpring& slack, double b);

// Forces without potential (follower.cpp).
void FindFollowers(MechanismModel& model);
void AddFollowerForce(const MechanismView& here, double factor, VectorX& tau);

// Energy (mechanism_energy.cpp).
const PoseEnergy& EnergyOfPose(const MechanismView& here);
double PotentialEnergyOn(const MechanismView& here, const RigidTransform& X_WR, const Vector3& gravity_W);
Potential PotentialOfSprings(const MechanismView& here, const RigidTransform& X_WR, const Vector3& gravity_W);

// The step of second order (theta_step.cpp).
void SizeTheta(const MechanismStep& here);
/// Velocities of the start of a step: q_dot_start and start_velocity, and of what floats center_W and linear_W.
void SeeStart(const MechanismStep& here, double h, StepRule rule);
void MoveToMiddle(const MechanismStep& here, double h);
void TakeMomenta(const MechanismStep& here);
void TakeForces(const MechanismStep& here, double h);
void SolveFreeMiddle(const MechanismStep& here, double h);
void SolveFreeMiddleWith(const MechanismStep& here, const ThetaScheme& rule, const VectorX& w_drag);
double WorkOfChord(const MechanismStep& here, double h);
void IntegrateMiddle(const MechanismStep& here, double h);
void TurnAndMove(const MechanismStep& here, double h, double end);

// Its energy (step_energy.cpp).
void KeepPotential(const MechanismStep& here, double h);
void TakeBoundsFromPotential(const MechanismStep& here);
double GainOfPotential(const MechanismStep& here);
bool BendsTooMuch(const MechanismStep& here, double held);
void VelocityAtEnd(const MechanismStep& here);
bool PayForPotential(const MechanismStep& here, double work, double lost);
bool MatchesPotential(const MechanismView& here);
bool GiveBack(const MechanismStep& here, double missed);
void TakeVelocity(const MechanismStep& here);

// Implicit Euler where nothing touches (euler_free.cpp).
double WorkToEnd(const MechanismStep& here, double h);
void StepAgainHalfWay(const MechanismStep& here, double h);

// Its end as a minimum (theta_minimum.cpp).
double MinimiseAtEnd(const MechanismStep& here, double h);

// An implicit stage (implicit_stage.cpp).
void PredictLinearMomentum(const MechanismStep& here, double time, const Vector3& linear_W);

// Lasting contact (two_steps.cpp).
/// What the next step will know of this one: all but how far it goes.
void KeepPast(const MechanismStep& here, double h);
void TakePast(const MechanismStep& here, double h);
void SolveFreeTwoSteps(const MechanismStep& here, double h);
void IntegrateTwoSteps(const MechanismStep& here, double h);

}  // namespace fork1s
