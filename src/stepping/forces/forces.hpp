// Force elements of a mechanism, a file each: what force, stiffness and damping they have at the pose at
// hand.
#pragma once

#include "../mechanism_workspace.hpp"
#include "stepping/mechanism_model.hpp"
#include "stepping/step_context.hpp"

namespace fork1s {

// Joint forces of the pose at hand (joint_forces.cpp).
/// Arms and stiffness of springs at the reference.
void ComputeSpringsAtReference(MechanismModel& model);
/// forces <- of springs, controls, weight and loads. Velocity forces are none of them: they come of the
/// momentum that is carried along.
void ComputeJointForces(const StepContext& ctx, const Vector3& gravity_R);

// Loads (applied_forces.cpp).
inline bool HasForcesFromOutside(const MechanismState& state) {
  return state.has_loads || state.point_spring.IsActive();
}
/// F += wrenches of loads and of the point spring without its damper, as AddLoadWrenches.
void AddAppliedWrenches(const ConstStepContext& ctx, Matrix6X& F);
/// loads.K <- geometric stiffness of the loads and of the point spring at the pose at hand.
void ComputeLoadStiffness(const StepContext& ctx);
/// A += b² times the geometric stiffness, as of loads, of the weight of the parts; with tension also of tendons, with
/// inertia of the forces (p̂ - p)/b that change their momenta within b at the pose and velocity at hand.
void AddGeometricStiffness(const StepContext& ctx, double b, GeometricStiffness of_parts);

// A point spring (point_spring.cpp).
/// point_spring <- at the pose at hand; f_z and the wrench on the base += its force.
void EvaluatePointSpring(const StepContext& ctx);
/// Force in R [N] with the damper, at the velocity that led to the pose at hand.
Vector3 PointSpringForce(const ConstStepContext& ctx);
/// A += its stiffness and damping in a stage of length b [s], but for the geometric stiffness.
void AddPointSpringOperator(const StepContext& ctx, double b);

// Lengths (lengths.cpp).
/// out = Qᵀ ∂ℓ/∂q
void ReducedRow(const Mechanism::Length& length, const std::vector<PathState>& paths, const RowMatrixX& Q,
                VectorX& out);

// Springs (springs.cpp).
/// A += weight e eᵀ, e the row that the spring of a length has in A: that of the pose for a path or where it `bends`,
/// else that of the reference, as in K_r.
void AddRankOneStiffness(const StepContext& ctx, const Mechanism::Length& length, double weight, bool bends);
/// A += weight times the stiffness of springs of paths, and of those that are not linear, at the pose beyond
/// that in K_r.
void AddNonlinearStiffness(const StepContext& ctx, double weight);

// Dampers (dampers.cpp).
/// Dampers and springs of joints by the columns that move them, and what the dampers are in D of the model.
void FindDampers(MechanismModel& model);
/// D += weight Σ (E Q_θ)ᵀ d (E Q_θ) over rotations with dampers, at the pose of `kinematics` and Q, in the
/// lower triangle. `rows`: scratch; no allocation where it has its size.
void AddRotationDamping(const MechanismModel& model, const Kinematics& kinematics, const RowMatrixX& Q,
                        double weight, RowMatrixX& rows, Eigen::Ref<MatrixX> D);
/// Whether dampers of joints change with the pose.
bool DamperOperatorDependsOnPose(const MechanismModel& model);
/// tau [n] -= b times the forces of dampers along lengths at joint rates q_dot [n].
void AddSpringDampers(const StepContext& ctx, double b, const VectorX& q_dot, VectorX& tau);
/// tau [n] += b times what the rates of their lengths change muscles by, at joint rates q_dot [n] (muscles.cpp).
void AddMuscleDampers(const StepContext& ctx, double b, const VectorX& q_dot, VectorX& tau);
/// A += the operator of the active parts of muscles in a stage of length b [s] (muscles.cpp).
void AddMuscleOperator(const StepContext& ctx, double b);
/// D += weight times what dampers are here beyond D of the model; `bent`: those of springs that are not
/// linear too, at the rates w [r].
void AddDamperChange(const StepContext& ctx, double weight, bool bent, const VectorX& w,
                     Eigen::Ref<MatrixX> D);

// Bounds of forces (force_limits.cpp); h [s]: the length of the stage.
/// Of a servo or motor at the pose at hand, N or N m.
double UnboundedForce(const ConstStepContext& ctx, const Mechanism::ForceLimit& limit);
double UnboundedForce(const ConstStepContext& ctx, const Mechanism::ForceLimit& limit, double length);
void SizeForceLimits(const StepContext& ctx);
/// What the forces with bounds and the slack springs are where a stage starts.
void InitializeActiveSet(const StepContext& ctx);
void EvaluateUnsaturatedForces(const StepContext& ctx);
/// After contact: those that are beyond a bound or back from it go into the solve. Whether there are any.
bool UpdateForceLimits(const StepContext& ctx, double h);
/// Whether the springs of servos change with the pose.
bool ServoOperatorDependsOnPose(const ConstStepContext& ctx);
/// A += what the pose makes of them.
void UpdateServoOperator(const StepContext& ctx, double h);
/// A -= springs and dampers of servos at a bound or in the solve.
void SubtractSaturatedStiffness(const StepContext& ctx, double h);
/// f_z <- with the forces of servos at a bound and of slack springs.
void AddActiveSetForces(const StepContext& ctx);
/// In a stage: rhs [num_velocities] without the dampers of servos at their bounds, at the velocity that led
/// to the pose.
void AddBackSaturatedDampers(const StepContext& ctx, double b, VectorX& rhs);
/// How far a length goes from the pose at hand to where its force acts, m or rad.
double LengthChangeToForceEvaluation(const StepContext& ctx, const Mechanism::Length& length, double h);
/// What servos at their bounds hold less than their springs at a pose, J.
double EnergyBeyondBounds(const ConstStepContext& ctx, const Configuration& at);

// Springs that are slack over a range (slack.cpp).
void FindSlackSprings(const StepContext& ctx);
void OpenSlackSprings(const StepContext& ctx);
/// At the end that the stage is taken to end at; 0 within the range.
double SlackStiffness(const MechanismModel& model, const SlackSpring& slack);
/// f_z += what the force there is beyond that at the start.
void AddSlackForces(const StepContext& ctx);
bool UpdateSlackSprings(const StepContext& ctx, double h);
/// Of the shorter (-1) or longer (1) end.
BoundedForceRow RowOfSlack(const StepContext& ctx, const SlackSpring& slack, int end, double h);
/// At the end of a stage of length b [s] that was solved [N or N·m].
double ForceOfSlack(const StepContext& ctx, const SlackSpring& slack, double b);

}  // namespace fork1s
