// Servos and motors that can give no more.
//
// The spring of a servo stands in A = M + hD + h²K, and its force at the end of the step is
//     f = f₀ - (h k + d) eᵀx,   f₀ = Σ share gain u + k (rest - ℓ),   dℓ/dt = eᵀx
// Where that is beyond a bound F, the servo pushes with F whatever the motion: its spring leaves A, and F
// takes the place of f₀:
//     A' = A - h (h k + d) e eᵀ,   rhs' = rhs + h (F - f₀) e
// Which servos are at a bound follows from the velocity with contact, so the step solves, with those at a bound
// that were so in the last step, and looks. Where that was right it is done. A servo that changes sides becomes a
// row of the contact solve, a compliant one between two bounds, which finds what it gives:
//     λ = clamp(h f₀ - h (h k + d) eᵀx, h F₋, h F₊)
// Rows only become more, so this ends; and of the sides that they end with the step is solved once more without
// them (world_servos.cpp).
#include <algorithm>
#include <cmath>

#include "mechanism_detail.hpp"

namespace fork1s {
namespace {

double Dot(const Mechanism::LinearForm& terms, const VectorX& values) {
  double sum = 0;
  for (const auto& [i, c] : terms) sum += c * values(i);
  return sum;
}

}  // namespace

double UnboundedForce(const MechanismView& here, const Mechanism::ForceLimit& limit) {
  const auto& [model, state, ws] = here;
  return Dot(limit.inputs, state.controls) + limit.stiffness * (limit.rest - Length(here, limit.length));
}

void SizeForceLimits(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  const auto count = model.mechanism().force_limits().size();
  ws.limit_force.resize(static_cast<Eigen::Index>(count));
  ws.limit_row.resize(model.size());
}

void OpenForceLimits(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  const auto& limits = model.mechanism().force_limits();
  for (std::size_t k = 0; k < limits.size(); ++k)
    ws.limit_force(static_cast<Eigen::Index>(k)) = UnboundedForce(here, limits[k]);
  // A holds the springs of those that were at a bound in the last step no longer.
  if (AnyAtBound(state)) ws.factored_h = -1;
}

bool AnyAtBound(const MechanismState& state) {
  return std::any_of(state.at_bound.begin(), state.at_bound.end(),
                     [](signed char side) { return side != 0; });
}

bool ServosTurn(const MechanismView& here) {
  const auto& [model, state, ws] = here;
  return model.reduced->loop_rank() > 0 && ActsAtPose(here);
}

// Loops turn Q as the pose moves, and the spring that A has at the reference with it. Elsewhere that does not
// matter: what the step leaves of it is in the next step's f₀. Here f at the end of the step decides, and of
// a stiff servo (1e9 N/m) the few per cent of the motion that the turn makes are more than its bound.
void TurnServos(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  if (!ServosTurn(here)) return;
  for (const Mechanism::ForceLimit& limit : model.mechanism().force_limits()) {
    const double spring = h * h * limit.stiffness;
    if (!(spring > 0)) continue;
    AddSpringOf(here, limit.length, -spring, false);
    AddSpringOf(here, limit.length, spring, true);
  }
}

void SubtractSaturatedStiffness(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  const auto& limits = model.mechanism().force_limits();
  for (std::size_t k = 0; k < limits.size(); ++k) {
    const double weight = h * h * limits[k].stiffness + ws.order * h * limits[k].damping;
    if (state.at_bound[k] != 0 && weight > 0) AddSpringOf(here, limits[k].length, -weight, ServosTurn(here));
  }
}

void OpenSwitches(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  ws.f_z_of_springs = ws.f_z;
  OpenForceLimits(here);
  OpenSlackSprings(here);
}

bool HasSwitches(const MechanismView& here) {
  return !here.state.at_bound.empty() || !here.work.slack.empty();
}

int NumForcesAtBound(const MechanismState& state) {
  return static_cast<int>(
      std::count_if(state.at_bound.begin(), state.at_bound.end(), [](signed char s) { return s != 0; }));
}

bool UpdateSwitches(const MechanismStep& here, double h) {
  const bool bounds = UpdateForceLimits(here, h), slack = UpdateSlackSprings(here, h);
  return bounds || slack;
}

void AddSwitchedForces(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  const auto& limits = model.mechanism().force_limits();
  ws.f_z = ws.f_z_of_springs;
  AddSlackForces(here);
  for (std::size_t k = 0; k < limits.size(); ++k) {
    if (state.at_bound[k] == 0) continue;
    // In the solve its whole force is found there.
    const double bound = state.at_bound[k] == MechanismState::kInSolve ? 0
                         : state.at_bound[k] > 0                       ? limits[k].upper
                                                                       : limits[k].lower;
    ReducedRow(limits[k].length, ws.paths(), ws.Q_now(), ws.limit_row);
    ws.f_z += (bound - ws.limit_force(static_cast<Eigen::Index>(k))) * ws.limit_row;
  }
}

void AddBackSaturatedDampers(const MechanismStep& here, double b, VectorX& rhs) {
  const auto& [model, state, ws] = here;
  const auto& limits = model.mechanism().force_limits();
  auto rhs_z = rhs.tail(model.size());
  for (std::size_t k = 0; k < limits.size(); ++k) {
    if (state.at_bound[k] == 0 || limits[k].damping == 0) continue;
    ReducedRow(limits[k].length, ws.paths(), ws.Q_now(), ws.limit_row);
    rhs_z -= b * limits[k].damping * ws.limit_row.dot(ws.contact_shift.tail(model.size())) * ws.limit_row;
  }
}

namespace {

// What the force at the end of the step loses to the velocity [N s/m].
double WeightInSolve(const MechanismView& here, const Mechanism::ForceLimit& limit, double h) {
  return h * limit.stiffness + here.work.order * limit.damping;
}

// By the velocity at hand and without bounds.
double ForceAtEnd(const MechanismStep& here, std::size_t k, double h) {
  const auto& [model, state, ws] = here;
  const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
  const double way = WayToForce(here, limit.length, h);
  double rate = ws.order * LengthRate(here, limit.length);
  if (ws.rule == StepRule::kMiddle) {  // what turning does to the velocity is seen by dampers too
    ws.f_used = ws.u.tail(model.size()) - ws.w_start;
    ForEachArm(limit.length, ws.paths(),
               [&](int i, double c) { rate += c * ws.Q_now().row(i).dot(ws.f_used); });
  }
  return ws.limit_force(static_cast<Eigen::Index>(k)) - limit.stiffness * way - limit.damping * rate;
}

signed char SideOf(const MechanismStep& here, std::size_t k, double h) {
  const Mechanism::ForceLimit& limit = here.model.mechanism().force_limits()[k];
  const double f = ForceAtEnd(here, k, h);
  return f > limit.upper ? 1 : f < limit.lower ? -1 : 0;
}

}  // namespace

ServoRow RowOfServo(const MechanismStep& here, std::size_t k, double h) {
  const auto& [model, state, ws] = here;
  const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
  const double weight = WeightInSolve(here, limit, h), f = ForceAtEnd(here, k, h);
  return {f / weight + LengthRate(here, limit.length), 1 / (h * weight), h * limit.lower, h * limit.upper};
}

void TakeSideOfServo(const MechanismStep& here, std::size_t k, double impulse, double h) {
  const auto& [model, state, ws] = here;
  const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
  // That of a stiff one is known better than its rate; a bound carries the rounding of the solve.
  constexpr double kRounding = 1e-12;
  const double force = impulse / h;
  state.at_bound[k] = force > limit.upper - kRounding * std::abs(limit.upper)   ? 1
                      : force < limit.lower + kRounding * std::abs(limit.lower) ? -1
                                                                                : 0;
  ws.factored_h = -1;
}

// Whether by the velocity at hand a servo is at another bound than the one by which that was found.
bool AnyChangesSides(const MechanismStep& here, double h) {
  const std::vector<signed char>& at_bound = here.state.at_bound;
  for (std::size_t k = 0; k < at_bound.size(); ++k)
    if (SideOf(here, k, h) != at_bound[k]) return true;
  return false;
}

namespace {

// At the end of a stage of length b that was solved.
double ForceOfServo(const MechanismStep& here, std::size_t k, double b) {
  const Mechanism::ForceLimit& limit = here.model.mechanism().force_limits()[k];
  return std::min(std::max(ForceAtEnd(here, k, b), limit.lower), limit.upper);
}

}  // namespace

void StoreSwitchedForces(const MechanismStep& here, double b) {
  const auto& [model, state, ws] = here;
  ws.stage_at_bound = state.at_bound;
  ws.stage_limit_force.resize(static_cast<Eigen::Index>(state.at_bound.size()));
  for (std::size_t k = 0; k < state.at_bound.size(); ++k)
    ws.stage_limit_force(static_cast<Eigen::Index>(k)) = ForceOfServo(here, k, b);
  ws.stage_slack_side.resize(ws.slack.size());
  ws.stage_slack_force.resize(static_cast<Eigen::Index>(ws.slack.size()));
  for (std::size_t k = 0; k < ws.slack.size(); ++k) {
    ws.stage_slack_side[k] = static_cast<signed char>(ws.slack[k].side);
    ws.stage_slack_force(static_cast<Eigen::Index>(k)) = ForceOfSlack(here, ws.slack[k], b);
  }
}

SaturationChange ComputeSaturationChange(const MechanismStep& here, double b, double onward) {
  const auto& [model, state, ws] = here;
  SaturationChange out;
  double largest = 0;
  const auto add = [&](const Mechanism::Length& length, double change, bool is_servo, std::size_t index) {
    if (out.index < 0) ws.rhs.setZero(model.num_velocities());
    ReducedRow(length, ws.paths(), ws.Q_now(), ws.limit_row);
    ws.rhs.tail(model.size()) += onward * b * change * ws.limit_row;
    if (out.index >= 0 && std::abs(change) <= largest) return;
    largest = std::abs(change);
    out.is_servo = is_servo;
    out.index = static_cast<int>(index);
  };
  for (std::size_t k = 0; k < state.at_bound.size(); ++k)
    if (state.at_bound[k] != ws.stage_at_bound[k])
      add(model.mechanism().force_limits()[k].length,
          ForceOfServo(here, k, b) - ws.stage_limit_force(static_cast<Eigen::Index>(k)), true, k);
  for (std::size_t k = 0; k < ws.slack.size(); ++k)
    if (ws.slack[k].side != ws.stage_slack_side[k])
      add(model.mechanism().springs()[ws.slack[k].spring].length,
          ForceOfSlack(here, ws.slack[k], b) - ws.stage_slack_force(static_cast<Eigen::Index>(k)), false,
          ws.slack[k].spring);
  if (out.index < 0) return out;
  const double mass = std::max(model.mechanism().total_mass(), 1e-300);
  ws.solved = ws.rhs;
  ws.factor.SolveInPlace(ws.solved);
  out.displacement = b * RootOf(ws.solved.dot(ws.rhs) / mass);
  ws.solved.noalias() = ws.M_full * ws.x;
  out.motion = b * RootOf(ws.x.dot(ws.solved) / mass);
  return out;
}

bool UpdateForceLimits(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  const auto& limits = model.mechanism().force_limits();
  bool changed = false;
  for (std::size_t k = 0; k < limits.size(); ++k) {
    signed char& at = state.at_bound[k];
    if (at == MechanismState::kInSolve) continue;
    const signed char side = SideOf(here, k, h);
    if (side == at) continue;
    changed = true;
    // A motor's force is known whatever the motion.
    const bool follows = WeightInSolve(here, limits[k], h) > 0 && model.part_of_force_limit[k] >= 0;
    at = follows ? MechanismState::kInSolve : side;
  }
  if (changed) ws.factored_h = -1;
  return changed;
}

// How far a length goes from the pose at which LoadForces found it to where its force acts.
double WayToForce(const MechanismStep& here, const Mechanism::Length& length, double h) {
  const auto& [model, state, ws] = here;
  const int r = model.size();
  if (model.by_twists()) return h * LengthRate(here, length);
  if (ws.rule != StepRule::kMiddle) {
    ws.f_used = h * (ws.x.tail(r) + ws.contact_shift.tail(r));
  } else {
    ws.f_turn = ws.x.tail(r) + ws.u.tail(r) - 2 * ws.w_start;
    ws.w_mean.noalias() = ws.scheme().Th * ws.f_turn;
    ws.w_mean += ws.w_start;
    ws.f_used = ws.z_before - state.reduced.z;
    ws.f_used.noalias() += h * (ws.scheme().Th * ws.w_mean);
  }
  double way = 0;
  ForEachArm(length, ws.paths(), [&](int i, double c) { way += c * ws.Q_now().row(i).dot(ws.f_used); });
  return way;
}

// e of a servo's spring as A has it, into limit_row.
void RowOfSpring(const MechanismStep& here, const Mechanism::Length& length) {
  const auto& [model, state, ws] = here;
  if (ServosTurn(here) || (length.path >= 0 && ActsAtPose(here)))
    ReducedRow(length, ws.paths(), ws.Q_now(), ws.limit_row);
  else
    ReducedRow(length, model.paths_ref, model.reduced->Q_rows, ws.limit_row);
}

// Where forces of A act on velocities beside x too, `beside` [r]: those of servos at their bounds taken out of them,
// `damping` as their dampers count there.
void AddBackBoundedSprings(const MechanismStep& here, double h, double damping,
                           const Eigen::Ref<const VectorX>& beside, Eigen::Ref<VectorX> rhs) {
  const auto& [model, state, ws] = here;
  const auto& limits = model.mechanism().force_limits();
  for (std::size_t k = 0; k < limits.size(); ++k) {
    if (state.at_bound[k] == 0) continue;
    RowOfSpring(here, limits[k].length);
    rhs += (h * h * limits[k].stiffness + h * damping * limits[k].damping) * ws.limit_row.dot(beside) *
           ws.limit_row;
  }
}

// Force of the reduced springs at z = `moved`, those of servos at their bounds left out.
void SpringPull(const MechanismStep& here, const VectorX& moved, VectorX& force) {
  const auto& [model, state, ws] = here;
  force = -model.reduced->K_r.cwiseProduct(moved);
  if (TakesBentSprings(here)) force.noalias() -= ws.K_beyond * moved;
  const bool turned = ws.rule != StepRule::kMiddle && ServosTurn(here);  // as TurnServos has them in A
  for (std::size_t k = 0; k < state.at_bound.size(); ++k) {
    const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
    if (turned) {
      ReducedRow(limit.length, model.paths_ref, model.reduced->Q_rows, ws.limit_row);
      force += limit.stiffness * ws.limit_row.dot(moved) * ws.limit_row;
      if (state.at_bound[k] != 0) continue;
      RowOfSpring(here, limit.length);
      force -= limit.stiffness * ws.limit_row.dot(moved) * ws.limit_row;
      continue;
    }
    if (state.at_bound[k] == 0) continue;
    RowOfSpring(here, limit.length);
    force += limit.stiffness * ws.limit_row.dot(moved) * ws.limit_row;
  }
}

namespace {

// What a servo at its bound F holds less than its spring: F ℓ in place of ½ k (ℓ - ℓ*)², f = k (ℓ* - ℓ).
double Beyond(const Mechanism::ForceLimit& limit, double f, double F, double length) {
  return limit.stiffness > 0 ? (f - F) * (f - F) / (2 * limit.stiffness) : (F - f) * length;
}

}  // namespace

double EnergyBeyondBounds(const MechanismView& here) {
  const auto& [model, state, ws] = here;
  double energy = 0;
  for (const Mechanism::ForceLimit& limit : model.mechanism().force_limits()) {
    if (!model.mechanism().HasPotential(limit.length)) continue;
    const double f = UnboundedForce(here, limit), F = std::min(std::max(f, limit.lower), limit.upper);
    if (f != F) energy += Beyond(limit, f, F, Length(here, limit.length));
  }
  return energy;
}

// Between its bounds at the end of a step, and beyond at its start: of the way there its spring, which A has from
// afar, knows nothing. A thousandth of what that bends by would be more than a servo can do.
bool IsCaught(const MechanismView& here, std::size_t k) {
  const auto& [model, state, ws] = here;
  const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
  const double f = ws.limits_start[k].first;
  return state.at_bound[k] == 0 && limit.stiffness > 0 && (f > limit.upper || f < limit.lower);
}

// What their springs are taken to have done along the chord, a way of h `w`.
double WorkOfCaught(const MechanismStep& here, double h, const Eigen::Ref<const VectorX>& w) {
  const auto& [model, state, ws] = here;
  double work = 0;
  for (std::size_t k = 0; k < state.at_bound.size(); ++k) {
    if (!IsCaught(here, k)) continue;
    const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
    // Its force is along the arms of the pose, what that changes by along those that A has.
    ReducedRow(limit.length, ws.paths(), ws.Q_now(), ws.limit_row);
    work += ws.limit_force(static_cast<Eigen::Index>(k)) * h * ws.limit_row.dot(w);
    RowOfSpring(here, limit.length);
    const double way = h * ws.limit_row.dot(w);
    double moved = 0.5 * way;
    if (ws.rule == StepRule::kMiddle) moved += ws.limit_row.dot(ws.z_before) - ws.limit_row.dot(state.reduced.z);
    work -= limit.stiffness * moved * way;
  }
  return work;
}

// A servo gives its bound for its damper's sake too, which no potential of the pose knows of. To a step its
// force is that of a spring or the bound, whichever it took, from start to end, and of one that was caught nothing is
// counted.
template <typename Pose>
double BeyondBoundsTaken(const MechanismView& here, const Pose& pose) {
  const auto& [model, state, ws] = here;
  double energy = 0;
  const auto& limits = model.mechanism().force_limits();
  for (std::size_t k = 0; k < limits.size(); ++k) {
    if (!model.mechanism().HasPotential(limits[k].length)) continue;
    if (state.at_bound[k] == 0) {
      if (!IsCaught(here, k)) continue;
      const double f = pose(k).first;
      energy += f * f / (2 * limits[k].stiffness);
      continue;
    }
    const auto [f, length] = pose(k);
    energy += Beyond(limits[k], f, state.at_bound[k] > 0 ? limits[k].upper : limits[k].lower, length);
  }
  return energy;
}

void KeepBoundedLengths(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  const auto& limits = model.mechanism().force_limits();
  ws.limits_start.resize(limits.size());
  for (std::size_t k = 0; k < limits.size(); ++k)
    ws.limits_start[k] = {UnboundedForce(here, limits[k]), Length(here, limits[k].length)};
}

double BeyondBoundsAtStart(const MechanismView& here) {
  const auto& [model, state, ws] = here;
  return BeyondBoundsTaken(here, [&](std::size_t k) { return ws.limits_start[k]; });
}

Potential PotentialOfStep(const MechanismView& here, const RigidTransform& X_WR) {
  const auto& [model, state, ws] = here;
  Potential out = PotentialOfSprings(here, X_WR, ws.gravity_W);
  const double beyond = BeyondBoundsTaken(here, [&](std::size_t k) {
    const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
    return std::pair(UnboundedForce(here, limit), Length(here, limit.length));
  });
  out.energy -= beyond;
  out.size += std::abs(beyond);
  return out;
}

}  // namespace fork1s
