// Springs that are slack over a range of their length.
//
// The force is linear in the length at the end of the step on either side of the range, and 0 within it:
//     f = F(s) - K(s) (ℓ + h dℓ/dt - (end + s)),   s: the stretch at the start, 0 where the start is not on
//     that side
// On which side the step ends follows from its velocity, so the step solves, looks, and solves again, as it
// does for servos at their bounds (force_limits.cpp). By the force of the start alone a stiff spring would be
// met unseen: at the end of that step it holds h²k/m times the energy of the motion.
#include "mechanism_detail.hpp"

namespace fork1s {

void FindSlackSprings(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  const Mechanism& m = model.mechanism();
  ws.slack.clear();
  for (std::size_t k = 0; k < m.springs().size(); ++k)
    if (m.springs()[k].slack > 0) ws.slack.push_back({k, 0, 0, 0});
}

void OpenSlackSprings(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  for (SlackSpring& slack : ws.slack) {
    const Mechanism::Spring& s = model.mechanism().springs()[slack.spring];
    slack.length = Length(here, s.length);
    slack.force = s.Force(slack.length);
    slack.side = s.SideOf(slack.length);
  }
}

// A has it: 0 within the range.
double SlackStiffness(const MechanismModel& model, const SlackSpring& slack) {
  const Mechanism::Spring& s = model.mechanism().springs()[slack.spring];
  if (slack.side == 0) return 0;
  return s.StiffnessOf(s.SideOf(slack.length) == slack.side ? s.Stretch(slack.length) : 0);
}

// What the force on the side of the end is beyond that of the start, which f_z has.
void AddSlackForces(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  for (const SlackSpring& slack : ws.slack) {
    const Mechanism::Spring& s = model.mechanism().springs()[slack.spring];
    if (s.SideOf(slack.length) == slack.side) continue;
    const double end = slack.side > 0 ? s.rest + s.slack : s.rest;
    const double force = slack.side == 0 ? 0 : -s.StiffnessOf(0) * (slack.length - end);
    ReducedRow(s.length, ws.paths(), ws.Q_now(), ws.limit_row);
    ws.f_z += (force - slack.force) * ws.limit_row;
  }
}

bool UpdateSlackSprings(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  bool changed = false;
  for (SlackSpring& slack : ws.slack) {
    const Mechanism::Spring& s = model.mechanism().springs()[slack.spring];
    int side = s.SideOf(slack.length + WayToForce(here, s.length, h));
    if (side * slack.side < 0) side = 0;  // between the two, as for servos
    changed = changed || side != slack.side;
    slack.side = side;
  }
  return changed;
}

double ForceOfSlack(const MechanismStep& here, const SlackSpring& slack, double b) {
  const Mechanism::Spring& s = here.model.mechanism().springs()[slack.spring];
  return s.Force(slack.length + WayToForce(here, s.length, b));
}

}  // namespace fork1s
