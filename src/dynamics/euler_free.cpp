// Implicit Euler where nothing touches: docs/method.md, section 5.
//
// A step about the pose half way keeps what spins, and poses a mechanism twice. Where springs hold every joint the pose
// of the start will do: velocities carried to the end lose the cosine of each turn there, which is known and given
// back, and what springs and weight bend by is made up for. A step whose motion cannot pay for that is taken again
// half way.
#include "mechanism_detail.hpp"

namespace fork1s {

// What floats or turns freely keeps its spin half way, and what has springs that bend by themselves their stiffness
// (TakesBentSprings).
bool GoesHalfWay(const MechanismModel& model) {
  return model.base_size > 0 || model.reduced->num_free > 0 || model.has_bent_springs || model.has_followers;
}

void ExpectNothing(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  if (model.reduced->has_complement) {
    ws.q_perp_before = state.reduced.q_perp;
    ws.interior_before = state.interior;
  }
  KeepPotential(here, h);
}

// Work of springs, weight and controls along the chord of the step as the solve knew them.
double WorkToEnd(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  const auto x = ws.x.tail(model.size());
  ws.f_used = h * x;
  SpringPull(here, ws.f_used, ws.f_turn);
  return h * x.dot(ws.f_z - ws.f_wrench + 0.5 * ws.f_turn) - WorkOfCaught(here, h, x);
}

void StepAgainHalfWay(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  state.reduced.z = ws.z_before;
  state.reduced.w = ws.x.tail(model.size()) = ws.w_before;
  state.reduced.X_WR = ws.X_WR_before;
  state.reduced.V_R = ws.V_R_before;
  if (model.reduced->has_complement) {
    state.reduced.q_perp = ws.q_perp_before;
    state.interior = ws.interior_before;
  }
  UpdateConfiguration(here);
  Begin(here, h, ws.gravity_W, StepRule::kMiddle);
  ActAtEnd(here);
  Predict(here, h, ws.gravity_W);
  ws.sides_unknown = AnyChangesSides(here, h);
  IntegrateMiddle(here, h);
}

}  // namespace fork1s
