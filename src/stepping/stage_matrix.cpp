// The matrix A = M + b D + b² K of a stage, (2) of implicit_stage.cpp, and its factor.
#include "linalg/row_squares.hpp"

#include "mechanism_detail.hpp"

namespace fork1s {
namespace {

// What joint springs are stiff by at the pose beyond K_r, where loops turn Q; adds b² times it to A.
void AddTurnedJointStiffness(const StepContext& ctx, double b) {
  const auto& [model, state, ws] = ctx;
  if (model.reduced->loop_rank() == 0) return;
  for (const WeightedRows& rows : model.at_reference.joint_springs) {
    AddRowSquares(ws.Q_now(), rows, b * b, ws.matrix.A.bottomRightCorner(model.size(), model.size()));
    AddRowSquares(model.reduced->Q_rows, rows, -b * b,
                  ws.matrix.A.bottomRightCorner(model.size(), model.size()));
  }
}

// Springs of paths, those that are not linear and loads turn and stiffen with the pose; all else in A is that
// of an earlier one.
bool StiffnessIsOfPose(const StepContext& ctx) {
  return ctx.model.at_reference.has_bent_springs || HasForcesFromOutside(ctx.state);
}

// A of (2), with the inertia at hand, but for what StiffnessIsOfPose tells of.
void ComputeMatrix(const StepContext& ctx, double b) {
  const auto& [model, state, ws] = ctx;
  const int r = model.size();
  ws.matrix.b = b;
  ws.matrix.at_bound = state.at_bound;
  ws.matrix.slack_sides.resize(ws.active_set.slack.size());
  for (std::size_t k = 0; k < ws.active_set.slack.size(); ++k)
    ws.matrix.slack_sides[k] = static_cast<signed char>(ws.active_set.slack[k].side);
  ws.matrix.A = ws.mass.M;
  if (ws.matrix.artificial_damping > 0)
    ws.matrix.A.bottomRightCorner(r, r) *= 1 + ws.matrix.artificial_damping;
  if (ws.expansion.in_use) {
    AddExpandedOperator(ctx, b);
  } else if (r > 0) {
    auto A_z = ws.matrix.A.bottomRightCorner(r, r);
    A_z += b * model.reduced->D;
    ws.velocities.w = ws.stage.v_k.tail(r);
    if (DamperOperatorDependsOnPose(model) || model.at_reference.has_bent_springs)
      AddDamperChange(ctx, b, true, ws.velocities.w, A_z);
    A_z.diagonal() += b * b * model.reduced->K_r;
    AddTurnedJointStiffness(ctx, b);
    UpdateServoOperator(ctx, b);
    SubtractSaturatedStiffness(ctx, b);
  }
  bool has_factor = false;
  if (ws.matrix.of_parts != GeometricStiffness::kNone && !ws.expansion.in_use) {
    ws.matrix.A_before = ws.matrix.A;
    AddGeometricStiffness(ctx, b, ws.matrix.of_parts);
    has_factor = ws.matrix.factor.Compute(ws.matrix.A);
    if (!has_factor) ws.matrix.A = ws.matrix.A_before;  // compressed: the iteration goes on without it
  }
  if (StiffnessIsOfPose(ctx))
    ws.matrix.A_before = ws.matrix.A;
  else
    ws.matrix.is_definite = has_factor || ws.matrix.factor.Compute(ws.matrix.A);
}

void AddStiffnessOfPose(const StepContext& ctx, double b) {
  const auto& [model, state, ws] = ctx;
  ws.matrix.A = ws.matrix.A_before;
  if (HasForcesFromOutside(state)) {
    ComputeLoadStiffness(ctx);
    ws.matrix.A.triangularView<Eigen::Lower>() += b * b * ws.loads.K;
  }
  if (state.point_spring.IsActive()) AddPointSpringOperator(ctx, b);
  if (model.size() > 0) {
    AddNonlinearStiffness(ctx, b * b);
    AddMuscleOperator(ctx, b);
  }
  ws.matrix.is_definite = ws.matrix.factor.Compute(ws.matrix.A);
}

bool MatrixFits(const StepContext& ctx, double b) {
  const auto& [model, state, ws] = ctx;
  if (ws.matrix.b != b || ws.matrix.at_bound != state.at_bound) return false;
  for (std::size_t k = 0; k < ws.active_set.slack.size(); ++k)
    if (ws.matrix.slack_sides[k] != ws.active_set.slack[k].side) return false;
  return true;
}

}  // namespace

void StartStageMatrix(const StepContext& ctx, double b) {
  ComputeMatrix(ctx, b);
  if (StiffnessIsOfPose(ctx)) ctx.work.matrix.is_definite = ctx.work.matrix.factor.Compute(ctx.work.matrix.A);
}

void RenewStageMatrix(const StepContext& ctx, GeometricStiffness of_parts) {
  UpdateMassMatrix(ctx);
  ctx.work.matrix.b = 0;
  ctx.work.matrix.of_parts = of_parts;
}

void UpdateStageMatrix(const StepContext& ctx, double b) {
  if (!MatrixFits(ctx, b)) ComputeMatrix(ctx, b);
  if (StiffnessIsOfPose(ctx)) AddStiffnessOfPose(ctx, b);
}

}  // namespace fork1s
