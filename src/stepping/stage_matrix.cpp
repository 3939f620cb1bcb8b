// The matrix A = M + b D + b² K of a stage, (2) of implicit_stage.cpp, and its factor.
#include "linalg/row_squares.hpp"

#include "mechanism_detail.hpp"

namespace fork1s {
namespace {

// What joint springs are stiff by at the pose beyond K_r, where loops turn Q; adds b² times it to A.
void AddTurnedJointStiffness(const MechanismStep& here, double b) {
  const auto& [model, state, ws] = here;
  if (model.reduced->loop_rank() == 0) return;
  for (const WeightedRows& rows : model.at_reference.joint_springs) {
    AddRowSquares(ws.Q_now(), rows, b * b, ws.matrix.A.bottomRightCorner(model.size(), model.size()));
    AddRowSquares(model.reduced->Q_rows, rows, -b * b,
                  ws.matrix.A.bottomRightCorner(model.size(), model.size()));
  }
}

// Springs of paths, those that are not linear and loads turn and stiffen with the pose; all else in A is that
// of an earlier one.
bool StiffnessIsOfPose(const MechanismStep& here) {
  return here.model.at_reference.has_bent_springs || HasForcesFromOutside(here.state);
}

// A of (2), with the inertia at hand, but for what StiffnessIsOfPose tells of.
void ComputeMatrix(const MechanismStep& here, double b) {
  const auto& [model, state, ws] = here;
  const int r = model.size();
  ws.matrix.b = b;
  ws.matrix.at_bound = state.at_bound;
  ws.matrix.slack_sides.resize(ws.switched.slack.size());
  for (std::size_t k = 0; k < ws.switched.slack.size(); ++k)
    ws.matrix.slack_sides[k] = static_cast<signed char>(ws.switched.slack[k].side);
  ws.matrix.A = ws.mass.M;
  if (ws.expansion.in_use) {
    AddExpandedOperator(here, b);
  } else if (r > 0) {
    auto A_z = ws.matrix.A.bottomRightCorner(r, r);
    A_z += b * model.reduced->D;
    ws.velocities.w = ws.stage.v_k.tail(r);
    if (DampersTurn(model) || model.at_reference.has_bent_springs)
      AddDampersBeyond(here, b, true, ws.velocities.w, A_z);
    A_z.diagonal() += b * b * model.reduced->K_r;
    AddTurnedJointStiffness(here, b);
    TurnServos(here, b);
    SubtractSaturatedStiffness(here, b);
  }
  bool has_factor = false;
  if (ws.matrix.of_parts != GeometricStiffness::kNone && !ws.expansion.in_use) {
    ws.matrix.A_before = ws.matrix.A;
    AddGeometricStiffness(here, b, ws.matrix.of_parts);
    has_factor = ws.matrix.factor.Compute(ws.matrix.A);
    if (!has_factor) ws.matrix.A = ws.matrix.A_before;  // compressed: the iteration goes on without it
  }
  if (StiffnessIsOfPose(here))
    ws.matrix.A_before = ws.matrix.A;
  else
    ws.matrix.is_definite = has_factor || ws.matrix.factor.Compute(ws.matrix.A);
}

void AddStiffnessOfPose(const MechanismStep& here, double b) {
  const auto& [model, state, ws] = here;
  ws.matrix.A = ws.matrix.A_before;
  if (HasForcesFromOutside(state)) {
    ComputeLoadStiffness(here);
    ws.matrix.A.triangularView<Eigen::Lower>() += b * b * ws.loads.K;
  }
  if (state.point_spring.IsActive()) AddPointSpringOperator(here, b);
  if (model.size() > 0) {
    AddNonlinearStiffness(here, b * b);
    AddMuscleOperator(here, b);
  }
  ws.matrix.is_definite = ws.matrix.factor.Compute(ws.matrix.A);
}

bool MatrixFits(const MechanismStep& here, double b) {
  const auto& [model, state, ws] = here;
  if (ws.matrix.b != b || ws.matrix.at_bound != state.at_bound) return false;
  for (std::size_t k = 0; k < ws.switched.slack.size(); ++k)
    if (ws.matrix.slack_sides[k] != ws.switched.slack[k].side) return false;
  return true;
}

}  // namespace

void StartStageMatrix(const MechanismStep& here, double b) {
  ComputeMatrix(here, b);
  if (StiffnessIsOfPose(here))
    here.work.matrix.is_definite = here.work.matrix.factor.Compute(here.work.matrix.A);
}

void RenewStageMatrix(const MechanismStep& here, GeometricStiffness of_parts) {
  UpdateMassMatrix(here);
  here.work.matrix.b = 0;
  here.work.matrix.of_parts = of_parts;
}

void UpdateStageMatrix(const MechanismStep& here, double b) {
  if (!MatrixFits(here, b)) ComputeMatrix(here, b);
  if (StiffnessIsOfPose(here)) AddStiffnessOfPose(here, b);
}

}  // namespace fork1s
