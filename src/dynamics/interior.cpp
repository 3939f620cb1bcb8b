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

// Wrenches stiffen too, and no potential has them: how much, along its way, the loads before and after the last
// step tell. 1/κ with Δ = (1 - s κ) Δ_last there.
double ShareThatLoadsAllow(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  const InteriorState& interior = state.interior;
  ApplyStiffness(model, interior.last_way, ws.held_back);
  const double own = ws.held_back.dot(interior.last_way);
  const double answer = own / interior.share - ws.held_back.dot(ws.q_perp_step);
  return answer > own ? own / answer : 1;
}

// With g of configuration, the pose of the start of the step. relaxed <- what springs, weight and controls
// gain by it [J], which nothing that the step moves has to pay for.
void FollowLoads(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  InteriorState& interior = state.interior;
  ws.rest = ws.g;
  // Loops turn with the pose: without their projector, reactions that are large and almost balanced would pass
  // for loads.
  ProjectOnLoops(*model.reduced, ws.configuration, ws.rest);
  ApplyComplement(*model.reduced, ws.rest, ws.q_perp_step);
  // First loads after a refresh: what they ask for at once is kept back and fades, so that nothing jumps.
  if (interior.offset.size() == 0) {
    interior.offset = ws.q_perp_step;
    interior.share = 1;
    interior.last_way.setZero(ws.q_perp_step.size());
  }
  ws.q_perp_step -= interior.offset;
  ApplyStiffness(model, ws.q_perp_step, ws.stretched);
  const double slope = ws.q_perp_step.dot(ws.stretched);  // of the merit below, falling
  // Wrenches, and what is held back, work on the way too.
  double outside = 0;
  double longest = 1;
  if (state.has_loads) {
    outside = WrenchForces(here).dot(ws.q_perp_step);
    longest = ShareThatLoadsAllow(here);
  }
  ApplyStiffness(model, interior.offset, ws.held_back);
  const double held = ws.held_back.dot(ws.q_perp_step);
  const double foreseen = 0.5 * slope - ws.rest.dot(ws.q_perp_step) + outside;
  double& share = interior.share;
  const auto go = [&] {
    interior.last_way = share * ws.q_perp_step;
    state.reduced.q_perp += interior.last_way;
  };
  // To third order that is what happens. It is looked at where it matters beside the motion, and where this step
  // takes back what the last one went: there whole steps may be too long.
  constexpr double kMatters = 1e-3;
  const bool turns_back = ws.stretched.dot(interior.last_way) < 0;
  if (share == 1 && longest == 1 && !turns_back && std::abs(foreseen) < kMatters * KineticEnergy(here)) {
    go();
    ws.relaxed = foreseen;
    return;
  }
  const Potential start = PotentialOfSprings(here, state.reduced.X_WR, ws.gravity_W);
  const double rounding = kPotentialRounding * (start.size + std::abs(foreseen));
  // Below the digits of energies the last share goes on.
  const auto go_unseen = [&] {
    go();
    ws.relaxed = share * (outside - ws.rest.dot(ws.q_perp_step)) + 0.5 * share * share * slope;
  };
  if (slope <= 100 * rounding) {
    share = std::min(longest, share);
    go_unseen();
    return;
  }
  ws.pose_energy.valid = false;
  std::swap(ws.configuration, ws.elsewhere);
  constexpr int kHalvings = 20;  // the potential falls along the way: what fails so often is rounding
  const double last_share = share;
  share = std::min(longest, 2 * share);
  bool falls = false;
  for (int i = 0; i < kHalvings; ++i, share *= 0.5) {
    go();
    ws.configuration.TakeLoops(ws.elsewhere);
    ConfigurePose(*model.reduced, state.reduced, ws.configuration);
    ws.pose_energy.valid = false;
    ws.relaxed = PotentialOfSprings(here, state.reduced.X_WR, ws.gravity_W).energy - start.energy;
    falls = ws.relaxed + share * (held - outside) < -1e-4 * share * slope + rounding;
    if (falls) break;
    state.reduced.q_perp -= interior.last_way;
  }
  if (!falls) {
    share = std::min(longest, last_share);
    go_unseen();
  }
  std::swap(ws.configuration, ws.elsewhere);
  ws.pose_energy.valid = false;
}

// Joint forces of the wrenches of the step, loops' reactions taken out.
const VectorX& WrenchForces(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  ws.F.setZero();
  AddLoadWrenches(here, ws.F);
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
