// The pose where a stage of a mechanism starts, and back to it: in the first stage the start of the step, in
// the second the end of the first.
#include "mechanism_detail.hpp"

namespace fork1s {

void RecordStageStart(const MechanismStep& here, bool of_step) {
  const auto& [model, state, ws] = here;
  ws.x_stage_start = of_step ? ws.x_start : ws.x;
  ws.z_stage_start = state.reduced.z;
  ws.X_stage_start = state.reduced.X_WR;
  ws.time_stage_start = ws.stage_time;
  if (model.base_size > 0)
    ws.center_stage_start =
        state.reduced.X_WR * CenterOfParts(model.rigid_parts, ws.configuration.kinematics);
}

void MoveToStageStart(const MechanismStep& here, double b) {
  const auto& [model, state, ws] = here;
  const StageBase& base = ws.stage_base;
  if (model.mechanism().base() == BaseKind::kDriven) {
    // Of rows at this pose the base moves on by its displacement within the stage, not by its rate at the
    // end.
    const RigidTransform X_end = state.reduced.X_WR;
    const Matrix3 R_start_end = ws.X_stage_start.rotation().transpose() * X_end.rotation();
    ws.V_R_stage << R_start_end * state.reduced.V_R.head<3>(), R_start_end * state.reduced.V_R.tail<3>();
    Vector6 displacement;
    displacement << LogRotation(R_start_end),
        ws.X_stage_start.rotation().transpose() * (X_end.translation() - ws.X_stage_start.translation());
    state.reduced.V_R = ws.V_R_stage - displacement / b;
  }
  ws.stage_time = ws.time_stage_start;
  state.reduced.z = ws.z_stage_start;
  state.reduced.X_WR = ws.X_stage_start;
  if (model.size() > 0) ws.x.tail(model.size()) = (ws.z_stage_start - base.z) / b;
  UpdatePose(here);
  if (model.base_size == 0) return;
  const Matrix3& R_WR = state.reduced.X_WR.rotation();
  ws.x.head<3>() = LogRotation(base.R_WR.transpose() * R_WR) / b;
  PredictLinearMomentum(here, ws.stage_time, ws.M_00(5, 5) / b * (ws.center_stage_start - base.center_W));
}

void RestoreStageBaseTwist(const MechanismStep& here) {
  if (here.model.mechanism().base() == BaseKind::kDriven) here.state.reduced.V_R = here.work.V_R_stage;
}

double LengthRateAtStageStart(const MechanismView& here, const Mechanism::Length& length) {
  return LengthRateBy(here, length, here.work.x_stage_start);
}

}  // namespace fork1s
