// Springs that are slack over a range of their length.
//
// The force is linear in the length at the end of the step on either side of the range, and 0 within it:
//     f = F(s) - K(s) (ℓ + h dℓ/dt - (end + s)),   s: the stretch at the start, 0 where the start is not on
//     that side
// On which side the step ends follows from its velocity, as for servos at their bounds (force_limits.cpp):
// where it is not the side that was taken, both ends become rows of the contact solve, the shorter one with f
// >= 0, the longer one with f <= 0, and the sides that these find are taken. By the force of the start alone
// a stiff spring would be met unseen: at the end of that step it holds h²k/m times the energy of the motion.
#include <limits>

#include "forces.hpp"

namespace fork1s {

void FindSlackSprings(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const Mechanism& m = model.mechanism();
  ws.active_set.slack.clear();
  for (std::size_t k = 0; k < m.springs().size(); ++k)
    if (m.springs()[k].slack > 0) ws.active_set.slack.push_back({k, 0, 0, 0});
}

void OpenSlackSprings(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  for (SlackSpring& slack : ws.active_set.slack) {
    const Mechanism::Spring& s = model.mechanism().springs()[slack.spring];
    slack.length = Length(ctx, s.length);
    slack.force = s.Force(slack.length);
    slack.side = s.SideOf(slack.length);
  }
}

namespace {

// Force on a side at the start of the step and how it falls with the length, linear to the end of the step.
struct SideForce {
  double force = 0, stiffness = 0;
};
SideForce ForceOnSide(const MechanismModel& model, const SlackSpring& slack, int side) {
  const Mechanism::Spring& s = model.mechanism().springs()[slack.spring];
  if (side == 0) return {};
  if (s.SideOf(slack.length) == side) return {slack.force, s.StiffnessOf(s.Stretch(slack.length))};
  const double end = side > 0 ? s.rest + s.slack : s.rest, stiffness = s.StiffnessOf(0);
  return {-stiffness * (slack.length - end), stiffness};
}

// In the solve its whole force is found there.
int SideOutsideSolve(const SlackSpring& slack) {
  return slack.side == MechanismState::kInSolve ? 0 : slack.side;
}

}  // namespace

// A has it: 0 within the range.
double SlackStiffness(const MechanismModel& model, const SlackSpring& slack) {
  return ForceOnSide(model, slack, SideOutsideSolve(slack)).stiffness;
}

// What the force on the side of the end is beyond that of the start, which f_z has.
void AddSlackForces(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  for (const SlackSpring& slack : ws.active_set.slack) {
    const double change = ForceOnSide(model, slack, SideOutsideSolve(slack)).force - slack.force;
    if (change == 0) continue;
    ReducedRow(model.mechanism().springs()[slack.spring].length, ws.paths(), ws.Q_now(),
               ws.scratch.length_row);
    ws.forces.f_z += change * ws.scratch.length_row;
  }
}

bool UpdateSlackSprings(const StepContext& ctx, double h) {
  const auto& [model, state, ws] = ctx;
  bool changed = false;
  for (std::size_t k = 0; k < ws.active_set.slack.size(); ++k) {
    SlackSpring& slack = ws.active_set.slack[k];
    if (slack.side == MechanismState::kInSolve) continue;
    const Mechanism::Spring& s = model.mechanism().springs()[slack.spring];
    const int side = s.SideOf(slack.length + LengthChangeToForceEvaluation(ctx, s.length, h));
    if (side == slack.side) continue;
    changed = true;
    const bool moves = model.part_of_bounded_force[model.mechanism().force_limits().size() + 2 * k] >= 0;
    slack.side = moves ? MechanismState::kInSolve : side;
  }
  return changed;
}

// An end whose force begins with the square of the stretch gives nothing to first order.
BoundedForceRow RowOfSlack(const StepContext& ctx, const SlackSpring& slack, int end, double h) {
  const auto& [model, state, ws] = ctx;
  const Mechanism::Length& length = model.mechanism().springs()[slack.spring].length;
  const SideForce at = ForceOnSide(model, slack, end);
  const double infinity = std::numeric_limits<double>::infinity();
  BoundedForceRow row;
  if (!(at.stiffness > 0)) return row;
  row.speed = at.force / (h * at.stiffness) - LengthChangeToForceEvaluation(ctx, length, h) / h +
              LengthRate(ctx, length);
  row.compliance = 1 / (h * h * at.stiffness);
  (end < 0 ? row.upper : row.lower) = end < 0 ? infinity : -infinity;
  return row;
}

double ForceOfSlack(const StepContext& ctx, const SlackSpring& slack, double b) {
  const Mechanism::Spring& s = ctx.model.mechanism().springs()[slack.spring];
  return s.Force(slack.length + LengthChangeToForceEvaluation(ctx, s.length, b));
}

}  // namespace fork1s
