// The pose where a stage of a mechanism starts, and back to it: in the first stage the start of the step, in
// the second the end of the first.
#include "mechanism_detail.hpp"

namespace fork1s {

void RecordStageStart(const MechanismStep& here, bool of_step) {
  const auto& [model, state, ws] = here;
  ws.stage_start.x = of_step ? ws.start.x : ws.x;
  ws.stage_start.z = state.reduced.z;
  ws.stage_start.X_WR = state.reduced.X_WR;
  ws.stage_start.time = ws.stage.time;
  if (model.base_size > 0)
    ws.stage_start.center_W =
        state.reduced.X_WR * CenterOfParts(model.rigid_parts, ws.configuration.kinematics);
}

void MoveToStageStart(const MechanismStep& here, double b) {
  const auto& [model, state, ws] = here;
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
  UpdatePose(here);
  if (model.base_size == 0) return;
  const Matrix3& R_WR = state.reduced.X_WR.rotation();
  ws.x.head<3>() = LogRotation(base.R_WR.transpose() * R_WR) / b;
  PredictLinearMomentum(here, ws.stage.time,
                        ws.mass.M_00(5, 5) / b * (ws.stage_start.center_W - base.center_W));
}

void RestoreStageBaseTwist(const MechanismStep& here) {
  if (here.model.mechanism().base() == BaseKind::kDriven)
    here.state.reduced.V_R = here.work.stage_start.V_R_end;
}

double LengthRateAtStageStart(const MechanismView& here, const Mechanism::Length& length) {
  return LengthRateBy(here, length, here.work.stage_start.x);
}

}  // namespace fork1s
