// Servos and motors that can give no more.
//
// The spring of a servo stands in A = M + hD + h²K, and its force at the end of the step is
//     f = f₀ - (h k + d) eᵀx,   f₀ = Σ share gain u + k (rest - ℓ),   dℓ/dt = eᵀx
// Where that is beyond a bound F, the servo pushes with F whatever the motion: its spring leaves A, and F
// takes the place of f₀:
//     A' = A - h (h k + d) e eᵀ,   rhs' = rhs + h (F - f₀) e
// Which servos are at a bound follows from the velocity with contact, so the step solves, with those at a
// bound that were so in the last step, and looks. Where that was right it is done. A servo that changes sides
// becomes a row of the contact solve, a compliant one between two bounds, which finds what it gives:
//     λ = clamp(h f₀ - h (h k + d) eᵀx, h F₋, h F₊)
// Rows only become more, so this ends; and of the sides that they end with the step is solved once more
// without them (world/bounded_forces.cpp). Springs with slack are treated alike (slack.cpp).
#include <algorithm>
#include <cmath>

#include "forces.hpp"

namespace fork1s {
namespace {

double InputForce(const MechanismState& state, const Mechanism::ForceLimit& limit) {
  double sum = 0;
  for (const auto& [i, c] : limit.inputs) sum += c * ActivationOf(state, i);
  return sum;
}

}  // namespace

double UnboundedForce(const MechanismView& here, const Mechanism::ForceLimit& limit, double length) {
  return InputForce(here.state, limit) + limit.stiffness * (limit.rest - length);
}

double UnboundedForce(const MechanismView& here, const Mechanism::ForceLimit& limit) {
  return UnboundedForce(here, limit, Length(here, limit.length));
}

void SizeForceLimits(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  const auto count = model.mechanism().force_limits().size();
  ws.switched.servo_force.resize(static_cast<Eigen::Index>(count));
  ws.scratch.length_row.resize(model.size());
}

void OpenForceLimits(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  const auto& limits = model.mechanism().force_limits();
  for (std::size_t k = 0; k < limits.size(); ++k)
    ws.switched.servo_force(static_cast<Eigen::Index>(k)) = UnboundedForce(here, limits[k]);
}

bool ServosTurn(const MechanismView& here) { return here.model.reduced->loop_rank() > 0; }

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
    const double weight = h * h * limits[k].stiffness + h * limits[k].damping;
    if (state.at_bound[k] != 0 && weight > 0) AddSpringOf(here, limits[k].length, -weight, ServosTurn(here));
  }
}

void OpenSwitches(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  ws.switched.f_z_without = ws.forces.f_z;
  OpenForceLimits(here);
  OpenSlackSprings(here);
}

bool HasSwitches(const MechanismView& here) {
  return !here.state.at_bound.empty() || !here.work.switched.slack.empty();
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
  ws.forces.f_z = ws.switched.f_z_without;
  AddSlackForces(here);
  for (std::size_t k = 0; k < limits.size(); ++k) {
    if (state.at_bound[k] == 0) continue;
    // In the solve its whole force is found there.
    const double bound = state.at_bound[k] == MechanismState::kInSolve ? 0
                         : state.at_bound[k] > 0                       ? limits[k].upper
                                                                       : limits[k].lower;
    ReducedRow(limits[k].length, ws.paths(), ws.Q_now(), ws.scratch.length_row);
    ws.forces.f_z += (bound - ws.switched.servo_force(static_cast<Eigen::Index>(k))) * ws.scratch.length_row;
  }
}

void AddBackSaturatedDampers(const MechanismStep& here, double b, VectorX& rhs) {
  const auto& [model, state, ws] = here;
  const auto& limits = model.mechanism().force_limits();
  auto rhs_z = rhs.tail(model.size());
  for (std::size_t k = 0; k < limits.size(); ++k) {
    if (state.at_bound[k] == 0 || limits[k].damping == 0) continue;
    ReducedRow(limits[k].length, ws.paths(), ws.Q_now(), ws.scratch.length_row);
    rhs_z += b * limits[k].damping * ws.scratch.length_row.dot(ws.stage.v_k.tail(model.size())) *
             ws.scratch.length_row;
  }
}

namespace {

// What the force at the end of the step loses to the velocity [N s/m].
double WeightInSolve(const Mechanism::ForceLimit& limit, double h) {
  return h * limit.stiffness + limit.damping;
}

// By the velocity at hand and without bounds.
double ForceAtEnd(const MechanismStep& here, std::size_t k, double h) {
  const auto& [model, state, ws] = here;
  const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
  return ws.switched.servo_force(static_cast<Eigen::Index>(k)) -
         limit.stiffness * WayToForce(here, limit.length, h) - limit.damping * LengthRate(here, limit.length);
}

signed char SideOf(const MechanismStep& here, std::size_t k, double h) {
  const Mechanism::ForceLimit& limit = here.model.mechanism().force_limits()[k];
  const double f = ForceAtEnd(here, k, h);
  return f > limit.upper ? 1 : f < limit.lower ? -1 : 0;
}

}  // namespace

namespace {

// Springs with slack have two bounded forces each, at the shorter end first.
std::size_t SlackOf(const MechanismView& here, std::size_t k) {
  return (k - here.model.mechanism().force_limits().size()) / 2;
}
int EndOf(const MechanismView& here, std::size_t k) {
  return (k - here.model.mechanism().force_limits().size()) % 2 == 0 ? -1 : 1;
}

}  // namespace

const Mechanism::Length& LengthOfBoundedForce(const MechanismView& here, std::size_t k) {
  const Mechanism& m = here.model.mechanism();
  return k < m.force_limits().size() ? m.force_limits()[k].length
                                     : m.springs()[here.work.switched.slack[SlackOf(here, k)].spring].length;
}

bool IsInSolve(const MechanismView& here, std::size_t k) {
  const auto& [model, state, ws] = here;
  return (k < state.at_bound.size() ? state.at_bound[k] : ws.switched.slack[SlackOf(here, k)].side) ==
         MechanismState::kInSolve;
}

BoundedForceRow RowOfBoundedForce(const MechanismStep& here, std::size_t k, double h) {
  const auto& [model, state, ws] = here;
  if (k >= state.at_bound.size())
    return RowOfSlack(here, ws.switched.slack[SlackOf(here, k)], EndOf(here, k), h);
  const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
  const double weight = WeightInSolve(limit, h), f = ForceAtEnd(here, k, h);
  return {f / weight + LengthRate(here, limit.length), 1 / (h * weight), h * limit.lower, h * limit.upper};
}

void SetSideOfBoundedForce(const MechanismStep& here, std::size_t k, double impulse, double unbounded,
                           double h) {
  const auto& [model, state, ws] = here;
  if (k >= state.at_bound.size()) {
    // Of the two ends, told one after the other, at most one pushes. Within its range a spring has an impulse
    // of 0 but for rounding.
    int& side = ws.switched.slack[SlackOf(here, k)].side;
    if (side == MechanismState::kInSolve) side = 0;
    if (impulse != 0 && unbounded * EndOf(here, k) < 0) side = EndOf(here, k);
    return;
  }
  const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
  // That of a stiff one is known better than its rate; a bound carries the rounding of the solve.
  constexpr double kRounding = 1e-12;
  const double force = impulse / h;
  state.at_bound[k] = force > limit.upper - kRounding * std::abs(limit.upper)   ? 1
                      : force < limit.lower + kRounding * std::abs(limit.lower) ? -1
                                                                                : 0;
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
  ws.switched.first_at_bound = state.at_bound;
  ws.switched.first_servo_force.resize(static_cast<Eigen::Index>(state.at_bound.size()));
  for (std::size_t k = 0; k < state.at_bound.size(); ++k)
    ws.switched.first_servo_force(static_cast<Eigen::Index>(k)) = ForceOfServo(here, k, b);
  ws.switched.first_slack_side.resize(ws.switched.slack.size());
  ws.switched.first_slack_force.resize(static_cast<Eigen::Index>(ws.switched.slack.size()));
  for (std::size_t k = 0; k < ws.switched.slack.size(); ++k) {
    ws.switched.first_slack_side[k] = static_cast<signed char>(ws.switched.slack[k].side);
    ws.switched.first_slack_force(static_cast<Eigen::Index>(k)) = ForceOfSlack(here, ws.switched.slack[k], b);
  }
}

SaturationChange ComputeSaturationChange(const MechanismStep& here, double b, double onward) {
  const auto& [model, state, ws] = here;
  SaturationChange out;
  double largest = 0;
  const auto add = [&](const Mechanism::Length& length, double change, bool is_servo, std::size_t index) {
    if (out.index < 0) ws.scratch.rhs.setZero(model.num_velocities());
    ReducedRow(length, ws.paths(), ws.Q_now(), ws.scratch.length_row);
    ws.scratch.rhs.tail(model.size()) += onward * b * change * ws.scratch.length_row;
    if (out.index >= 0 && std::abs(change) <= largest) return;
    largest = std::abs(change);
    out.is_servo = is_servo;
    out.index = static_cast<int>(index);
  };
  for (std::size_t k = 0; k < state.at_bound.size(); ++k)
    if (state.at_bound[k] != ws.switched.first_at_bound[k])
      add(model.mechanism().force_limits()[k].length,
          ForceOfServo(here, k, b) - ws.switched.first_servo_force(static_cast<Eigen::Index>(k)), true, k);
  for (std::size_t k = 0; k < ws.switched.slack.size(); ++k)
    if (ws.switched.slack[k].side != ws.switched.first_slack_side[k])
      add(model.mechanism().springs()[ws.switched.slack[k].spring].length,
          ForceOfSlack(here, ws.switched.slack[k], b) -
              ws.switched.first_slack_force(static_cast<Eigen::Index>(k)),
          false, ws.switched.slack[k].spring);
  if (out.index < 0) return out;
  const double mass = std::max(model.mechanism().total_mass(), 1e-300);
  ws.scratch.solved = ws.scratch.rhs;
  ws.matrix.factor.SolveInPlace(ws.scratch.solved);
  out.displacement = b * RootOf(ws.scratch.solved.dot(ws.scratch.rhs) / mass);
  ws.scratch.solved.noalias() = ws.mass.M * ws.x;
  out.motion = b * RootOf(ws.x.dot(ws.scratch.solved) / mass);
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
    const bool follows = WeightInSolve(limits[k], h) > 0 && model.part_of_bounded_force[k] >= 0;
    at = follows ? MechanismState::kInSolve : side;
  }
  return changed;
}

// How far a length goes from the pose at which LoadForces found it to where its force acts.
double WayToForce(const MechanismStep& here, const Mechanism::Length& length, double h) {
  const auto& [model, state, ws] = here;
  const int r = model.size();
  ws.switched.way = h * (ws.x.tail(r) - ws.stage.v_k.tail(r));
  double way = 0;
  ForEachArm(length, ws.paths(), [&](int i, double c) { way += c * ws.Q_now().row(i).dot(ws.switched.way); });
  return way;
}

namespace {

// What a servo at its bound F holds less than its spring: F ℓ in place of ½ k (ℓ - ℓ*)², f = k (ℓ* - ℓ).
double Beyond(const Mechanism::ForceLimit& limit, double f, double F, double length) {
  return limit.stiffness > 0 ? (f - F) * (f - F) / (2 * limit.stiffness) : (F - f) * length;
}

}  // namespace

double EnergyBeyondBounds(const MechanismView& here, const Configuration& at) {
  const auto& [model, state, ws] = here;
  double energy = 0;
  for (const Mechanism::ForceLimit& limit : model.mechanism().force_limits()) {
    if (!model.mechanism().HasPotential(limit.length)) continue;
    const double length = LengthOf(model.mechanism(), limit.length, at.kinematics, at.q),
                 f = UnboundedForce(here, limit, length), F = std::min(std::max(f, limit.lower), limit.upper);
    if (f != F) energy += Beyond(limit, f, F, length);
  }
  return energy;
}

}  // namespace fork1s
