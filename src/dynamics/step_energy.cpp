// What a step knows of energy: docs/method.md, section 5.
//
// The forces of a step work along its chord as if springs were straight. Where potentials bend within the step,
// their true change differs from that; the difference is made up for along the motion, either way, so that a
// step ends with the energy that its rule gives it and not more.
#include <algorithm>
#include <cmath>

#include "mechanism_detail.hpp"

namespace fork1s {
namespace {

// The root of a κ² + b κ = d that is nearest to 0; where there is none the lowest point.
double SmallRoot(double a, double b, double d) {
  const double inside = b * b + 4 * a * d;
  if (inside <= 0) return a > 0 ? -b / (2 * a) : 0;
  const double sum = b + std::copysign(std::sqrt(inside), b);
  return sum != 0 ? 2 * d / sum : 0;
}

// Where the base stands while weights work.
const RigidTransform& WeighedOn(const MechanismView& here) {
  return here.model.mechanism().base() == BaseKind::kDriven ? here.work.weighed_on : here.state.reduced.X_WR;
}

// rhs <- w without momentum of the whole, solved <- M times it.
void TakeRelativeMotion(const MechanismStep& here, const Eigen::Ref<const VectorX>& w) {
  const auto& [model, state, ws] = here;
  ws.rhs.tail(model.size()) = w;
  if (model.base_size > 0) ws.rhs.head<6>() = -SolvePositive(ws.M_00, ws.M_0z * w);
  ws.solved.noalias() = ws.M_full * ws.rhs;  // base rows 0: no momentum
}

// Adds `energy` to the kinetic energy along the relative motion of the step, and where that has less than is
// owed, as after a turn by a radian, along that of its end. The momentum of the whole stays. What is still owed
// then [J]: below 0, or 0.
double MatchWork(const MechanismStep& here, double energy) {
  const auto& [model, state, ws] = here;
  for (const bool at_end : {false, true}) {
    if (at_end)
      TakeRelativeMotion(here, ws.x.tail(model.size()));
    else
      TakeRelativeMotion(here, ws.w_mean);
    const double a = 0.5 * ws.solved.dot(ws.rhs), b = ws.solved.dot(ws.x), share = SmallRoot(a, b, energy);
    ws.x += share * ws.rhs;
    energy -= (a * share + b) * share;
    if (!(energy < -kPotentialRounding * ws.potential_size)) return 0;
  }
  return energy;
}

}  // namespace

// Gain of potential energy since the start of the step [J].
double GainOfPotential(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  const Potential end = PotentialOfStep(here, WeighedOn(here));
  ws.potential_size = std::max(ws.potential_size, end.size);
  return end.energy - ws.potential_start;
}

// Of the pose of the start. A driven base works from where it is half way, so that its own way counts for none.
void KeepPotential(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  ws.matches = true;
  if (model.mechanism().base() == BaseKind::kDriven)
    ws.weighed_on = state.reduced.X_WR * Exp(0.5 * h * state.reduced.V_R);
  const Potential start = PotentialOfSprings(here, WeighedOn(here), ws.gravity_W);
  ws.potential_start = start.energy;
  ws.potential_size = start.size;
  KeepBoundedLengths(here);
}

// Once it is known which servos give their bounds.
void TakeBoundsFromPotential(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  const double beyond = BeyondBoundsAtStart(here);
  ws.potential_start -= beyond;
  ws.potential_size += std::abs(beyond);
}

// Whether springs came to hold so much more than foreseen that the motion of the joints cannot pay for it: along
// w̄ it has (w̄·M x)²/2 w̄·M w̄ to give. `held`: what they hold beyond that [J].
bool BendsTooMuch(const MechanismStep& here, double held) {
  const auto& [model, state, ws] = here;
  const double beyond = held - kPotentialRounding * ws.potential_size;
  if (!(beyond > 0)) return false;
  TakeRelativeMotion(here, ws.w_mean);
  const double along = ws.solved.dot(ws.x), inertia = ws.solved.dot(ws.rhs);
  const double has = inertia > 0 ? along * along / (2 * inertia) : 0;
  return beyond > 0.5 * has;
}

// The velocity x that the pose at hand makes of the momenta of parts, of which tau and F_parts are what joints and
// base feel.
void VelocityAtEnd(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  const int r = model.size();
  if (model.num_velocities() == 0) return;
  if (r > 0) ReduceForce(*model.reduced, ws.Q_now(), ws.tau, ws.f_used);
  if (r > 0) ws.momentum.tail(r) = ws.f_used;
  if (model.base_size > 0) ws.momentum.head<6>() = ws.F_parts.col(0);
  ws.x = ws.momentum;
  SolveOrFail(ws.inertia_factor, ws.M_full, ws.x);
}

// x that has paid for what the potential's true change differs from `work`, that along the chord, and got back
// what was lost on the way [J]. False where it has not that much to give.
bool PayForPotential(const MechanismStep& here, double work, double lost) {
  return !MatchesPotential(here) || GiveBack(here, lost - work - GainOfPotential(here));
}

// Whether what is known of the energy is enough: the work of springs without potential is known at one pose alone.
bool MatchesPotential(const MechanismView& here) {
  const auto& [model, state, ws] = here;
  return model.size() > 0 && ws.matches && !model.has_follower_springs;
}

// x with `missed` more kinetic energy [J]. False where it is less, and x has not that much to give.
bool GiveBack(const MechanismStep& here, double missed) {
  const auto& [model, state, ws] = here;
  // Below the digits of the two it would keep alive what comes to rest.
  return !(std::abs(missed) > kPotentialRounding * ws.potential_size) || MatchWork(here, missed) == 0;
}

void TakeVelocity(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  state.reduced.w = ws.x.tail(model.size());
  if (model.base_size > 0) state.reduced.V_R = ws.x.head<6>();
}

}  // namespace fork1s
