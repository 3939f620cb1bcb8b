// What the interior's own displacement q_perp does in a step: docs/method.md, section 5.
//
// Coordinates that were left out follow the loads of the pose at rest,
//     q_perp += s Δ,   Δ = C_perp g - o
// a step of Newton with the stiffness of the reference (on trees with linear springs all of the way), g all joint
// forces of the pose with loops' reactions taken out, o what is held back since the last refresh so that nothing
// jumps. Loads may stiffen the interior to more than twice its springs, as they do a rope under tension, and then
// whole steps overshoot by more each time: s is the first of 1, 1/2, ... from twice the last one on by which the
// potential falls.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <algorithm>
#include <cmath>

namespace fork1s {

// With g_ of configuration_, the pose of the start of the step. relaxed_ <- what springs, weight and controls
// gain by it [J], which nothing that the step moves has to pay for.
void MechanismDynamics::FollowLoads() {
  rest_ = g_;
  // Loops turn with the pose: without their projector, reactions that are large and almost balanced would pass
  // for loads.
  ProjectOnLoops(model(), configuration_, rest_);
  ApplyComplement(model(), rest_, q_perp_step_);
  // First loads after a refresh: what they ask for at once is kept back and fades, so that nothing jumps.
  if (state_.q_perp_offset.size() == 0) {
    state_.q_perp_offset = q_perp_step_;
    state_.interior_share = 1;
  }
  q_perp_step_ -= state_.q_perp_offset;
  ApplyStiffness(q_perp_step_, stretched_);
  const double slope = q_perp_step_.dot(stretched_);  // of the merit below, falling
  // Wrenches, and what is held back, work on the way too.
  double outside = 0;
  if (state_.has_wrenches) outside = WrenchForces().dot(q_perp_step_);
  ApplyStiffness(state_.q_perp_offset, held_back_);
  const double held = held_back_.dot(q_perp_step_);
  const double foreseen = 0.5 * slope - rest_.dot(q_perp_step_) + outside;
  double& share = state_.interior_share;
  // To third order that is what happens. Where it matters beside the motion it is looked at, as far as energies
  // can tell: below their digits the last share goes on.
  constexpr double kMatters = 1e-3;
  if (share == 1 && std::abs(foreseen) < kMatters * KineticEnergy()) {
    state_.reduced.q_perp += q_perp_step_;
    relaxed_ = foreseen;
    return;
  }
  const double start = PotentialOfSprings(state_.reduced.X_WR, gravity_W_);
  const double rounding = 1e-13 * (std::abs(start) + std::abs(foreseen));
  if (slope < 100 * rounding) {
    state_.reduced.q_perp += share * q_perp_step_;
    relaxed_ = share * (outside - rest_.dot(q_perp_step_)) + 0.5 * share * share * slope;
    return;
  }
  pose_energy_.valid = false;
  std::swap(configuration_, elsewhere_);
  constexpr int kHalvings = 20;
  share = std::min(1.0, 2 * share);
  for (int i = 0;; ++i, share *= 0.5) {
    state_.reduced.q_perp += share * q_perp_step_;
    configuration_.TakeLoops(elsewhere_);
    Configure(model(), state_.reduced, configuration_);
    pose_energy_.valid = false;
    relaxed_ = PotentialOfSprings(state_.reduced.X_WR, gravity_W_) - start;
    if (relaxed_ + share * (held - outside) < -1e-4 * share * slope + rounding || i == kHalvings) break;
    state_.reduced.q_perp -= share * q_perp_step_;
  }
  std::swap(configuration_, elsewhere_);
  pose_energy_.valid = false;
}

// Joint forces of the wrenches of the step, loops' reactions taken out.
const VectorX& MechanismDynamics::WrenchForces() {
  for (int b = 0; b < mechanism().num_bodies(); ++b)
    F_.col(b) = AdjointTransposeApply(state_.reduced.X_WR, state_.wrenches_W.col(b));
  tau_.setZero();
  AccumulateGeneralizedForce(mechanism(), configuration_.kinematics.S, F_, tau_);
  ProjectOnLoops(model(), configuration_, tau_);
  return tau_;
}

// By K_q of the reference.
void MechanismDynamics::ApplyStiffness(const VectorX& q, VectorX& force) const {
  if (stiffness_ref_.size() > 0)
    force.noalias() = stiffness_ref_ * q;
  else
    force = mechanism().stiffness().cwiseProduct(q);
}

}  // namespace fork1s
