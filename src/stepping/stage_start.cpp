// The pose where a stage of a mechanism starts, and back to it: in the first stage the start of the step, in
// the second the end of the first.
#include "mechanism_detail.hpp"

namespace fork1s {

void RecordStageStart(const StepContext& ctx, bool of_step) {
  const auto& [model, state, ws] = ctx;
  ws.stage_start.x = of_step ? ws.start.x : ws.x;
  ws.stage_start.z = state.reduced.z;
  ws.stage_start.X_WR = state.reduced.X_WR;
  ws.stage_start.time = of_step ? 0 : ws.stage.time;
  if (model.base_size > 0)
    ws.stage_start.center_W =
        state.reduced.X_WR * CenterOfParts(model.rigid_parts, ws.configuration.kinematics);
}

void MoveToStageStart(const StepContext& ctx, double b) {
  const auto& [model, state, ws] = ctx;
  const StageBase& base = ws.stage.base;
  if (model.mechanism().base() == BaseKind::kDriven) {
    // Of rows at this pose the base moves on by its displacement within the stage, not by its rate at the
    // end.
    const RigidTransform X_end = state.reduced.X_WR;
    const Matrix3 R_start_end = ws.stage_start.X_WR.rotation().transpose() * X_end.rotation();
    ws.stage_start.V_R_end << R_start_end * state.reduced.V_R.head<3>(),
        R_start_end * state.reduced.V_R.tail<3>();
    Vector6 displacement;
    displacement << LogRotation(R_start_end), ws.stage_start.X_WR.rotation().transpose() *
                                                  (X_end.translation() - ws.stage_start.X_WR.translation());
    state.reduced.V_R = ws.stage_start.V_R_end - displacement / b;
  }
  ws.stage.time = ws.stage_start.time;
  state.reduced.z = ws.stage_start.z;
  state.reduced.X_WR = ws.stage_start.X_WR;
  if (model.size() > 0) ws.x.tail(model.size()) = (ws.stage_start.z - base.z) / b;
  UpdatePose(ctx);
  if (model.base_size == 0) return;
  const Matrix3& R_WR = state.reduced.X_WR.rotation();
  ws.x.head<3>() = LogRotation(base.R_WR.transpose() * R_WR) / b;
  PredictLinearMomentum(ctx, ws.stage.time,
                        ws.mass.M_00(5, 5) / b * (ws.stage_start.center_W - base.center_W));
}

void RestoreStageBaseTwist(const StepContext& ctx) {
  if (ctx.model.mechanism().base() == BaseKind::kDriven) ctx.state.reduced.V_R = ctx.work.stage_start.V_R_end;
}

double LengthRateAtStageStart(const ConstStepContext& ctx, const Mechanism::Length& length) {
  return LengthRateBy(ctx, length, ctx.work.stage_start.x);
}

}  // namespace fork1s
