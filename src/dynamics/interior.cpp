// What the interior's own displacement q_perp does in a step: docs/method.md, section 5.
//
// Coordinates that were left out follow the loads of the pose at rest,
//     q_perp += s Δ,   Δ = C_perp g - o
// a step of Newton with the stiffness of the reference (on trees with linear springs all of the way), g all joint
// forces of the pose with loops' reactions taken out, o what is held back since the last refresh so that nothing
// jumps. Loads may stiffen the interior to more than twice its springs, as they do a rope under tension, and then
// whole steps overshoot by more each time: s is the first of 1, 1/2, ... from twice the last one on by which the
// potential falls.
#include <algorithm>
#include <cmath>

#include "mechanism_detail.hpp"

namespace fork1s {

// With g of configuration, the pose of the start of the step. relaxed <- what springs, weight and controls
// gain by it [J], which nothing that the step moves has to pay for.
void FollowLoads(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  ws.rest = ws.g;
  // Loops turn with the pose: without their projector, reactions that are large and almost balanced would pass
  // for loads.
  ProjectOnLoops(*model.reduced, ws.configuration, ws.rest);
  ApplyComplement(*model.reduced, ws.rest, ws.q_perp_step);
  // First loads after a refresh: what they ask for at once is kept back and fades, so that nothing jumps.
  if (state.q_perp_offset.size() == 0) {
    state.q_perp_offset = ws.q_perp_step;
    state.interior_share = 1;
  }
  ws.q_perp_step -= state.q_perp_offset;
  ApplyStiffness(model, ws.q_perp_step, ws.stretched);
  const double slope = ws.q_perp_step.dot(ws.stretched);  // of the merit below, falling
  // Wrenches, and what is held back, work on the way too.
  double outside = 0;
  if (state.has_wrenches) outside = WrenchForces(here).dot(ws.q_perp_step);
  ApplyStiffness(model, state.q_perp_offset, ws.held_back);
  const double held = ws.held_back.dot(ws.q_perp_step);
  const double foreseen = 0.5 * slope - ws.rest.dot(ws.q_perp_step) + outside;
  double& share = state.interior_share;
  // To third order that is what happens. Where it matters beside the motion it is looked at, as far as energies
  // can tell: below their digits the last share goes on.
  constexpr double kMatters = 1e-3;
  if (share == 1 && std::abs(foreseen) < kMatters * KineticEnergy(here)) {
    state.reduced.q_perp += ws.q_perp_step;
    ws.relaxed = foreseen;
    return;
  }
  const Potential start = PotentialOfSprings(here, state.reduced.X_WR, ws.gravity_W);
  const double rounding = kPotentialRounding * start.size;
  if (slope < 100 * rounding) {
    state.reduced.q_perp += share * ws.q_perp_step;
    ws.relaxed = share * (outside - ws.rest.dot(ws.q_perp_step)) + 0.5 * share * share * slope;
    return;
  }
  ws.pose_energy.valid = false;
  std::swap(ws.configuration, ws.elsewhere);
  constexpr int kHalvings = 20;
  share = std::min(1.0, 2 * share);
  for (int i = 0;; ++i, share *= 0.5) {
    state.reduced.q_perp += share * ws.q_perp_step;
    ws.configuration.TakeLoops(ws.elsewhere);
    Configure(*model.reduced, state.reduced, ws.configuration);
    ws.pose_energy.valid = false;
    ws.relaxed = PotentialOfSprings(here, state.reduced.X_WR, ws.gravity_W).energy - start.energy;
    if (ws.relaxed + share * (held - outside) < -1e-4 * share * slope + rounding || i == kHalvings) break;
    state.reduced.q_perp -= share * ws.q_perp_step;
  }
  std::swap(ws.configuration, ws.elsewhere);
  ws.pose_energy.valid = false;
}

// Joint forces of the wrenches of the step, loops' reactions taken out.
const VectorX& WrenchForces(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  for (int b = 0; b < model.mechanism().num_bodies(); ++b)
    ws.F.col(b) = AdjointTransposeApply(state.reduced.X_WR, state.wrenches_W.col(b));
  ws.tau.setZero();
  AccumulateGeneralizedForce(model.mechanism(), ws.configuration.kinematics.S, ws.F, ws.tau);
  ProjectOnLoops(*model.reduced, ws.configuration, ws.tau);
  return ws.tau;
}

// By K_q of the reference.
void ApplyStiffness(const MechanismModel& model, const VectorX& q, VectorX& force) {
  if (model.stiffness_ref.size() > 0)
    force.noalias() = model.stiffness_ref * q;
  else
    force = model.mechanism().stiffness().cwiseProduct(q);
}

}  // namespace fork1s
