// One reduced mechanism in motion: forces, the implicit operator, refresh.
//
// docs/method.md, section 5. A step is one implicit stage or two (implicit_stage.cpp).
//
// Functions here read a const model, move a state of plain values, and keep in a workspace what follows from
// the two and what one step alone needs. Only src/stepping changes the workspace; src/diagnostics reads it.
#pragma once

#include <fork1s/stepping/linearization_drift.hpp>
#include <fork1s/stepping/mechanism_state.hpp>
#include <memory>
#include <vector>

#include "stepping/stage_motion.hpp"

namespace fork1s {

struct MechanismModel;      // mechanism_model.hpp
struct MechanismWorkspace;  // src/stepping/mechanism_workspace.hpp
struct VelocityRange;       // mechanism_model.hpp

/// In the matrix of a stage: of what accelerates the parts, as of light links that a heavy body stretches; of the tension
/// of tendons, near the solution, since far from it Newton's iteration would go to another one.
enum class GeometricStiffness { kNone, kOfWeight, kOfWeightAndTension, kOfWeightAndInertia };

/// What moves.
struct StepContext {
  const MechanismModel& model;
  MechanismState& state;
  MechanismWorkspace& work;
};

/// What is only looked at.
struct ConstStepContext {
  ConstStepContext(const MechanismModel& of_model, const MechanismState& of_state,
                   const MechanismWorkspace& of_work)
      : model(of_model), state(of_state), work(of_work) {}
  ConstStepContext(const StepContext& step) : ConstStepContext(step.model, step.state, step.work) {}

  const MechanismModel& model;
  const MechanismState& state;
  const MechanismWorkspace& work;
};

// Inputs.

/// Force [N] and moment [N·m] on a body, constant in world axes during the next step only. The force acts at
/// the point of the body that is at `point_W` now.
void AddWrench(const StepContext& ctx, BodyIndex body, const Vector3& force_W, const Vector3& moment_W,
               const Vector3& point_W);
void SetPointSpring(const StepContext& ctx, BodyIndex body, const PointSpring& spring);
void ClearLoads(MechanismState& state);
/// F += wrenches of the loads at the pose at hand [6 x bodies], in R about R's origin.
void AddLoadWrenches(const ConstStepContext& ctx, Matrix6X& F);
/// Loads for the next step are those of `start`, and controls and the pose of a driven base where they
/// are after a share of a step that begins there.
void SetInputsWithin(const StepContext& ctx, const MechanismState& start, double share);
/// Activations are those after a share of a step of length h that begins at `start` (activation.cpp).
void AdvanceActivations(const StepContext& ctx, const MechanismState& start, double share, double h);
/// Inputs between two shares of a step of length h that begins at `start`.
void SetInputsOfPart(const StepContext& ctx, const MechanismState& start, double h, double share_start,
                     double share_end);
/// The path of a driven base in a step of length h from `state`.
BasePath PathOfBase(const MechanismState& state, double h);
/// After a step of length h from `start`.
void StoreBaseHistory(const StepContext& ctx, const MechanismState& start, double h);

// A step.

/// x += A⁻¹ Jᵀ F for generalized impulses p [num_velocities].
void ApplyImpulse(const StepContext& ctx, const VectorX& p);
/// Whether servos with bounds or springs with slack make the step solve in rounds.
bool HasComplementarity(const ConstStepContext& ctx);
/// After contact: which servos are at a bound of their force at the present velocity, and which springs are
/// slack. True if that differs from what the velocity was computed with; then SolveFreeStage and solve
/// contact again.
bool UpdateActiveSet(const StepContext& ctx, double h);
// Forces with bounds, as many as MechanismModel::part_of_bounded_force, are force limits first, then springs
// with slack, which have two each: of the shorter end, at 0 or more, and of the longer one, at 0 or less.
const Mechanism::Length& LengthOfBoundedForce(const ConstStepContext& ctx, std::size_t k);
/// Whether the contact solve is to find it.
bool IsInSolve(const ConstStepContext& ctx, std::size_t k);
/// A force with bounds in the contact solve: its impulse is (speed - rate of its length)/compliance between
/// two bounds.
struct BoundedForceRow {
  double speed = 0;             // m/s or rad/s, at which it gives nothing
  double compliance = 0;        // 1/kg or 1/(kg m²), as of LimitConstraint
  double lower = 0, upper = 0;  // N s or N m s
};
/// By the velocity at hand, of one that is in the solve.
BoundedForceRow RowOfBoundedForce(const StepContext& ctx, std::size_t k, double h);
/// Which bound it is at, if any, by the impulse that was found and that of its rate without bounds. Solve the
/// stage again thereafter.
void SetSideOfBoundedForce(const StepContext& ctx, std::size_t k, double impulse, double unbounded, double h);
/// Servos and motors that give all they can.
int NumForcesAtBound(const MechanismState& state);

// The stages of a step (implicit_stage.cpp), b: length of a stage [s].

/// Begins a step of h [s]: impulse of a driven base whose twist changes, the base points of the first stage,
/// of length b [s], and the velocity predicted for its end. `by_chord`: a driven base goes at its mean rate.
void BeginStep(const StepContext& ctx, double h, double b, bool by_chord, const Vector3& gravity_W);
/// Controls of the first stage, of length b [s], of a step that begins at `start`: of what held controls
/// jumped by as much as the mechanism follows within the step (control_jump.cpp). `onward`: s of the scheme.
void ReduceControlJumps(const StepContext& ctx, const MechanismState& start, double b, double onward);
/// Moves to the pose x̂ ⊕ b v with the velocity v at hand and evaluates configuration and inertia there; v of
/// a floating base is then along its axes there. `time` [s]: from the start of the step to the end of the
/// stage.
void MoveToStagePose(const StepContext& ctx, double b, double time);
/// Records the pose and velocity at hand as those where the next stage starts (stage_start.cpp); `of_step`:
/// the first.
void RecordStageStart(const StepContext& ctx, bool of_step);
/// Moves to that pose; the velocity at hand becomes the one that leads there from the base point, and the
/// twist of a driven base what its displacement within the stage leaves of it, until RestoreStageBaseTwist.
void MoveToStageStart(const StepContext& ctx, double b);
void RestoreStageBaseTwist(const StepContext& ctx);
/// Momenta and forces at that pose, with the twist restored.
void EvaluateStage(const StepContext& ctx, double b);
/// Velocity of the stage without contact by (2) of implicit_stage.cpp at the pose at hand.
void SolveFreeStage(const StepContext& ctx, double b);
/// A and its factor, but for stiffness that the pose changes, before the first pose.
void StartStageMatrix(const StepContext& ctx, double b);
/// The matrix of the stage is made again, with the inertia of the pose at hand, by the next solve, and where it stays
/// positive definite with the geometric stiffness of weight or of all that accelerates the parts.
void RenewStageMatrix(const StepContext& ctx, GeometricStiffness of_parts);
/// After contact, at the pose linearized at.
StageChange ComputeStageChange(const StepContext& ctx, double b);
/// After contact: records the momenta of the stage, moves to the pose found, and returns the change of
/// position that another Newton iteration would make [m], in the kinetic metric.
double MoveAndComputeResidual(const StepContext& ctx, double b, double time);
/// After contact, in place of MoveAndComputeResidual: the stage is solved. Moves to the pose found,
/// `with_derivatives`: Q and Jacobians too.
void AcceptStage(const StepContext& ctx, double b, double time, bool with_derivatives);
/// Until set anew: damps the reduced velocities by `ratio` times their inertia over the length of the stage.
void SetArtificialDamping(const StepContext& ctx, double ratio);
/// m: displacement within b by the reduced velocities, in the kinetic metric.
double JointDisplacement(const StepContext& ctx, double b);
/// After ComputeStageChange, which returned `change`: takes back a share of the change of velocity that the iteration made.
void ShortenStage(const StepContext& ctx, double share, StageChange& change);
/// The same after MoveAndComputeResidual, and moves.
void RelaxStage(const StepContext& ctx, double b, double time, double share);
/// Forces of servos and slack springs at the end of a stage of length b [s] that was solved, and their
/// saturation.
void StoreActiveSetForces(const StepContext& ctx, double b);
/// What the changes of saturation since StoreActiveSetForces displace by the extrapolation of the first stage's forces.
struct SaturationChange {
  double displacement = 0, motion = 0;  // m, in the kinetic metric: b |A⁻¹ s b Δf|; of the stage
  bool is_servo = true;                 // else a slack spring
  int index = -1;                       // in force_limits() or springs(), of the largest Δf
};
SaturationChange ComputeSaturationChange(const StepContext& ctx, double b, double onward);
/// Base points of the second stage, start + onward (end of the first stage - start), and a velocity to start it with.
void ExtrapolateStage(const StepContext& ctx, double b, double onward);
/// `between_stages` [s]: from the end of the first stage to that of the second; 0 after backward Euler.
void EndStep(const StepContext& ctx, double between_stages);

// Between steps.

/// Puts back a state, of here or of another mechanism that was created the same way; the model follows it.
void Restore(MechanismState& state, MechanismWorkspace& work, const MechanismState& saved);
/// As MechanismDynamics::ComputeLinearizationDrift.
LinearizationDrift ComputeLinearizationDrift(const ConstStepContext& ctx);
/// Keeps what a step from `start` did to the loads, for the two functions below: the joint forces of stops,
/// dry frictions and servos at their bounds in the last stage, and the change of the controls. Impulses are
/// those of the last stage, as of AddStopForces.
void RecordLoads(const StepContext& ctx, const MechanismState& start,
                 const std::vector<double>& limit_impulses, const std::vector<double>& friction_impulses);
/// After a step of h [s]: displacement that joint forces and contact forces of the last stage lack at rest,
/// as a share of 1e-3 rad or lengths of the mechanism in a joint. The share is 0 until they have lacked it
/// for so long that it would have moved by as much, and within three steps of the last refresh. A refresh
/// gives them load columns. `contact_impulses_R`: of the last stage, about R's origin [6 x bodies].
LinearizationDrift FindMissingLoad(const StepContext& ctx, double h, const Matrix6X& contact_impulses_R);
/// After a step of h [s]: expands about the present pose where the last expansion is too far, and goes by exact poses
/// where joints turn too fast for that. Allocates then. Whether it expanded.
bool UpdateExpansion(const StepContext& ctx, double h);
/// After a part of a step: by exact poses from here on where the expansion is too far.
void DropExpansionIfFar(const StepContext& ctx);
/// False where joints have turned so far from the expansion that it tells nothing of the pose.
bool IsWithinExpansion(const ConstStepContext& ctx);
/// As MechanismDynamics::Refresh.
bool Refresh(MechanismState& state, MechanismWorkspace& work);

// Ports: what contacts see.

/// J_T (size of its part x 6), transposed map from x to the twist of group g in R; the driven base's own twist
/// comes on top. No part moves a group that only follows its base: then J_T is left alone.
void GroupJacobian(const ConstStepContext& ctx, int g, Eigen::Ref<MatrixX> J_T);
/// Twist of group g at velocity x.
Vector6 GroupTwist(const ConstStepContext& ctx, int g, const Eigen::Ref<const MatrixX>& J_T);
/// In a stage: the same of the velocity where it starts.
Vector6 GroupTwistAtStart(const ConstStepContext& ctx, int g, const Eigen::Ref<const MatrixX>& J_T);
RigidTransform GroupPose(const ConstStepContext& ctx, int g);
/// Twist of group g in world axes about the origin of the body that names it.
Vector6 GroupVelocity(const ConstStepContext& ctx, int g);
/// Solves L Y = Jᵀ in place (columns of one part), A = L Lᵀ with the part's velocities from the last to the
/// first, as the rows of Y are then: W = Yᵀ Y.
void HalfSolve(const ConstStepContext& ctx, const VelocityRange& part, Eigen::Ref<MatrixX> Jt);

// Lengths that springs, stops and motors act on.

/// Rate of a length per unit of its part's velocities, at the present pose.
void LengthRow(const ConstStepContext& ctx, const Mechanism::Length& length, const VelocityRange& part,
               Eigen::Ref<VectorX> row);
double LengthRate(const ConstStepContext& ctx, const Mechanism::Length& length);
/// Change of the rate of a length by a unit impulse along it, 1/kg or 1/(kg m²), at the start of a step.
double RatePerImpulse(const StepContext& ctx, const Mechanism::Length& length);
/// By the velocity x [num_velocities]; by that where the stage at hand starts.
double LengthRateBy(const ConstStepContext& ctx, const Mechanism::Length& length, const VectorX& x);
double LengthRateAtStageStart(const ConstStepContext& ctx, const Mechanism::Length& length);
/// Counted from q = 0.
double Length(const ConstStepContext& ctx, const Mechanism::Length& length);
/// tau [n] += what a force along a length is on the joints.
void AddLengthForce(const ConstStepContext& ctx, const Mechanism::Length& length, double force, VectorX& tau);
/// tau [n] += joint forces of stops and dry frictions by their impulses within h [s] [N s or N m s]: two of
/// every length limit, lower and upper, and one of every friction.
void AddStopForces(const ConstStepContext& ctx, double h, const std::vector<double>& limit_impulses,
                   const std::vector<double>& friction_impulses, VectorX& tau);

// What a state is as bodies see it.

double KineticEnergy(const ConstStepContext& ctx);
/// Springs, controls and gravity at the present pose [J].
double PotentialEnergy(const ConstStepContext& ctx, const Vector3& gravity_W);
double ClosureGapNow(const ConstStepContext& ctx);
bool IsFinite(const ConstStepContext& ctx);
bool PosesAreFinite(const ConstStepContext& ctx);
/// What the loops are open by at the pose at hand [rad and m]; 0 between expansions, where nobody closes
/// them.
double LoopResidualNow(const ConstStepContext& ctx);
/// Pose of a body in the world at the present state.
RigidTransform BodyPose(const ConstStepContext& ctx, BodyIndex b);
/// Of all bodies in the frame of its root, side by side where they are many.
void BodyPoses(const ConstStepContext& ctx, std::vector<RigidTransform>& X_RB);
/// Twist of a body in world axes about its own origin.
Vector6 BodyVelocity(const ConstStepContext& ctx, BodyIndex b);
const Configuration& ConfigurationOf(const ConstStepContext& ctx);

}  // namespace fork1s
