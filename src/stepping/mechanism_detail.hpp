// The parts of a mechanism's step, by the files that have them.
#pragma once

#include <cmath>

#include "forces/forces.hpp"
#include "mechanism_workspace.hpp"
#include "stepping/mechanism_model.hpp"
#include "stepping/step_context.hpp"

namespace fork1s {

// Workspace and pose (mechanism_pose.cpp).
/// What a new reference makes of loops and of coordinates without a load.
void StartAtReference(const MechanismModel& model, MechanismState& state);
/// The workspace, that of another model so far.
void Renew(const StepContext& ctx);
void Size(const StepContext& ctx);
void UpdateConfiguration(const StepContext& ctx, bool loops_are_closed = false);  // by the µ at hand
void UpdateMassMatrix(const StepContext& ctx);                           // inertia, by the Jacobians at hand
void UpdatePose(const StepContext& ctx, bool loops_are_closed = false);  // configuration and Jacobians

// Expansions (expansions.cpp).
/// Begins with an expansion about the present z, where the model steps by them.
void StartExpansions(const StepContext& ctx);
/// The expansion that the state tells of, where it has one.
void RestoreExpansion(const StepContext& ctx);
/// The exact pose of joints in place of that of an expansion.
void UseExactPose(const StepContext& ctx);
/// For the step that begins: the expansion, or the exact pose where loads act that no expansion knows.
void ChooseEvaluator(const StepContext& ctx);
/// After a step by exact poses: an expansion about where it ended, for what follows.
void EndWithExpansion(const StepContext& ctx);

// A stage (implicit_stage.cpp).
void PredictLinearMomentum(const StepContext& ctx, double time, const Vector3& linear_W);
void ClearOneShotInputs(const StepContext& ctx);
// The matrix of a stage (stage_matrix.cpp).
/// A and its factor for a stage of length b [s] at the pose at hand: again where the length or saturation
/// differ, else what of its stiffness changes with the pose.
void UpdateStageMatrix(const StepContext& ctx, double b);

/// The activation of a control with dynamics after t [s] of a step of length h that begins at `start`
/// (activation.cpp).
double ActivationAfter(const MechanismState& start, Eigen::Index control, double t, double h);
/// As ActivationsOf; in scratch, or the controls themselves where none has dynamics.
const VectorX& UpdateActivations(const StepContext& ctx);
/// Of the present pose and controls.
ReductionLoads LoadsOf(const MechanismOptions& options, const MechanismState& state,
                       const Matrix6X& wrenches_R, const VectorX& control_change);

// Parts that move independently (mechanism_ports.cpp).
void FindDecoupledBlocks(MechanismModel& model);
/// Factors of the workspace know them.
void DivideIntoParts(const StepContext& ctx);

}  // namespace fork1s
