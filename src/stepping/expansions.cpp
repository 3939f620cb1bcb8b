// When a mechanism is expanded about its pose, and which steps go by that.
//
// A step by an expansion visits no joint: inertia to first order, forces to first, interface poses to second
// (reduction/expansion.hpp). Loads from outside may act anywhere; a step with them goes by exact poses. Both
// move the same z and w.
#include <algorithm>
#include <cmath>

#include "mechanism_detail.hpp"

namespace fork1s {

void StartExpansions(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  if (!model.expands) return;
  Expand(here);
  ws.is_expanded = true;
  UpdateConfiguration(here);
}

void RestoreExpansion(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  ws.is_expanded = state.expanded_at.size() > 0;
  if (!ws.is_expanded ||
      (ws.expanded && ws.expanded->of == model.reduced && ws.expanded->expansion.z == state.expanded_at))
    return;
  ReducedState at = state.reduced;
  at.z = state.expanded_at;
  Configuration c(*model.reduced);
  c.mu = state.mu;
  ConfigureClosed(*model.reduced, at, c);
  ExpandAt(here, c);
}

void ChooseEvaluator(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  if (!ws.is_expanded || !HasForcesFromOutside(state)) return;
  ws.is_expanded = false;
  ws.configuration.mu = state.mu;
  ws.configuration.foresees = false;
  UpdateConfiguration(here);
}

void EndWithExpansion(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  if (!model.expands || ws.is_expanded) return;
  ws.is_expanded = true;
  UpdatePose(here);
}

bool ExpandIfFar(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  if (!ws.is_expanded) return false;
  // Where a joint has turned so far, what the step leaves out is that of its time step.
  constexpr double kAngle = 0.07;  // rad, 4 degrees; slides: this share of the length scale
  const Mechanism& m = model.mechanism();
  const Expansion& expansion = ws.expanded->expansion;
  double share = 0;
  for (int i = 0; i < m.num_coordinates(); ++i) {
    const double moved = std::abs(expansion.Q.row(i).dot(ws.expanded_pose.delta));
    share = std::max(share, moved / (m.Turns(i) ? kAngle : kAngle * m.length_scale()));
  }
  if (!(share > 1)) return false;
  // The momentum of the coordinates is kept.
  ws.rhs.noalias() = ws.mass.M * ws.x;
  Expand(here);
  UpdateConfiguration(here);
  SolveOrFail(ws.mass.factor, ws.mass.M, ws.rhs);
  ws.x = ws.rhs;
  state.reduced.w = ws.x;
  return true;
}

}  // namespace fork1s
