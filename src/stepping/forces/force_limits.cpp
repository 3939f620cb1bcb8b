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

double UnboundedForce(const ConstStepContext& ctx, const Mechanism::ForceLimit& limit, double length) {
  return InputForce(ctx.state, limit) + limit.stiffness * (limit.rest - length);
}

double UnboundedForce(const ConstStepContext& ctx, const Mechanism::ForceLimit& limit) {
  return UnboundedForce(ctx, limit, Length(ctx, limit.length));
}

void SizeForceLimits(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const auto count = model.mechanism().force_limits().size();
  ws.active_set.servo_force.resize(static_cast<Eigen::Index>(count));
  ws.scratch.length_row.resize(model.size());
}

void EvaluateUnsaturatedForces(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const auto& limits = model.mechanism().force_limits();
  for (std::size_t k = 0; k < limits.size(); ++k)
    ws.active_set.servo_force(static_cast<Eigen::Index>(k)) = UnboundedForce(ctx, limits[k]);
}

bool ServoOperatorDependsOnPose(const ConstStepContext& ctx) { return ctx.model.reduced->loop_rank() > 0; }

// Loops turn Q as the pose moves, and the spring that A has at the reference with it. Elsewhere that does not
// matter: what the step leaves of it is in the next step's f₀. Here f at the end of the step decides, and of
// a stiff servo (1e9 N/m) the few per cent of the motion that the turn makes are more than its bound.
void UpdateServoOperator(const StepContext& ctx, double h) {
  const auto& [model, state, ws] = ctx;
  if (!ServoOperatorDependsOnPose(ctx)) return;
  for (const Mechanism::ForceLimit& limit : model.mechanism().force_limits()) {
    const double spring = h * h * limit.stiffness;
    if (!(spring > 0)) continue;
    AddRankOneStiffness(ctx, limit.length, -spring, false);
    AddRankOneStiffness(ctx, limit.length, spring, true);
  }
}

void SubtractSaturatedStiffness(const StepContext& ctx, double h) {
  const auto& [model, state, ws] = ctx;
  const auto& limits = model.mechanism().force_limits();
  for (std::size_t k = 0; k < limits.size(); ++k) {
    const double weight = h * h * limits[k].stiffness + h * limits[k].damping;
    if (state.at_bound[k] != 0 && weight > 0)
      AddRankOneStiffness(ctx, limits[k].length, -weight, ServoOperatorDependsOnPose(ctx));
  }
}

void InitializeActiveSet(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  ws.active_set.f_z_without = ws.forces.f_z;
  EvaluateUnsaturatedForces(ctx);
  OpenSlackSprings(ctx);
}

bool HasComplementarity(const ConstStepContext& ctx) {
  return !ctx.state.at_bound.empty() || !ctx.work.active_set.slack.empty();
}

int NumForcesAtBound(const MechanismState& state) {
  return static_cast<int>(
      std::count_if(state.at_bound.begin(), state.at_bound.end(), [](signed char s) { return s != 0; }));
}

bool UpdateActiveSet(const StepContext& ctx, double h) {
  const bool bounds = UpdateForceLimits(ctx, h), slack = UpdateSlackSprings(ctx, h);
  return bounds || slack;
}

void AddActiveSetForces(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const auto& limits = model.mechanism().force_limits();
  ws.forces.f_z = ws.active_set.f_z_without;
  AddSlackForces(ctx);
  for (std::size_t k = 0; k < limits.size(); ++k) {
    if (state.at_bound[k] == 0) continue;
    // In the solve its whole force is found there.
    const double bound = state.at_bound[k] == MechanismState::kInSolve ? 0
                         : state.at_bound[k] > 0                       ? limits[k].upper
                                                                       : limits[k].lower;
    ReducedRow(limits[k].length, ws.paths(), ws.Q_now(), ws.scratch.length_row);
    ws.forces.f_z +=
        (bound - ws.active_set.servo_force(static_cast<Eigen::Index>(k))) * ws.scratch.length_row;
  }
}

void AddBackSaturatedDampers(const StepContext& ctx, double b, VectorX& rhs) {
  const auto& [model, state, ws] = ctx;
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
double ForceAtEnd(const StepContext& ctx, std::size_t k, double h) {
  const auto& [model, state, ws] = ctx;
  const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
  return ws.active_set.servo_force(static_cast<Eigen::Index>(k)) -
         limit.stiffness * LengthChangeToForceEvaluation(ctx, limit.length, h) -
         limit.damping * LengthRate(ctx, limit.length);
}

signed char SideOf(const StepContext& ctx, std::size_t k, double h) {
  const Mechanism::ForceLimit& limit = ctx.model.mechanism().force_limits()[k];
  const double f = ForceAtEnd(ctx, k, h);
  return f > limit.upper ? 1 : f < limit.lower ? -1 : 0;
}

}  // namespace

namespace {

// Springs with slack have two bounded forces each, at the shorter end first.
std::size_t SlackOf(const ConstStepContext& ctx, std::size_t k) {
  return (k - ctx.model.mechanism().force_limits().size()) / 2;
}
int EndOf(const ConstStepContext& ctx, std::size_t k) {
  return (k - ctx.model.mechanism().force_limits().size()) % 2 == 0 ? -1 : 1;
}

}  // namespace

const Mechanism::Length& LengthOfBoundedForce(const ConstStepContext& ctx, std::size_t k) {
  const Mechanism& m = ctx.model.mechanism();
  return k < m.force_limits().size() ? m.force_limits()[k].length
                                     : m.springs()[ctx.work.active_set.slack[SlackOf(ctx, k)].spring].length;
}

bool IsInSolve(const ConstStepContext& ctx, std::size_t k) {
  const auto& [model, state, ws] = ctx;
  return (k < state.at_bound.size() ? state.at_bound[k] : ws.active_set.slack[SlackOf(ctx, k)].side) ==
         MechanismState::kInSolve;
}

BoundedForceRow RowOfBoundedForce(const StepContext& ctx, std::size_t k, double h) {
  const auto& [model, state, ws] = ctx;
  if (k >= state.at_bound.size())
    return RowOfSlack(ctx, ws.active_set.slack[SlackOf(ctx, k)], EndOf(ctx, k), h);
  const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
  const double weight = WeightInSolve(limit, h), f = ForceAtEnd(ctx, k, h);
  return {f / weight + LengthRate(ctx, limit.length), 1 / (h * weight), h * limit.lower, h * limit.upper};
}

void SetSideOfBoundedForce(const StepContext& ctx, std::size_t k, double impulse, double unbounded,
                           double h) {
  const auto& [model, state, ws] = ctx;
  if (k >= state.at_bound.size()) {
    // Of the two ends, told one after the other, at most one pushes. Within its range a spring has an impulse
    // of 0 but for rounding.
    int& side = ws.active_set.slack[SlackOf(ctx, k)].side;
    if (side == MechanismState::kInSolve) side = 0;
    if (impulse != 0 && unbounded * EndOf(ctx, k) < 0) side = EndOf(ctx, k);
    return;
  }
  const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
  // That of a stiff one is known better than its rate; a bound, which may be 0, carries the rounding of the solve.
  const auto size = [](double bound) { return std::isfinite(bound) ? std::abs(bound) : 0; };
  const double force = impulse / h, rounding = 1e-12 * std::max(size(limit.lower), size(limit.upper));
  state.at_bound[k] = force >= limit.upper - rounding ? 1 : force <= limit.lower + rounding ? -1 : 0;
}

namespace {

// At the end of a stage of length b that was solved.
double ForceOfServo(const StepContext& ctx, std::size_t k, double b) {
  const Mechanism::ForceLimit& limit = ctx.model.mechanism().force_limits()[k];
  return std::min(std::max(ForceAtEnd(ctx, k, b), limit.lower), limit.upper);
}

}  // namespace

void StoreActiveSetForces(const StepContext& ctx, double b) {
  const auto& [model, state, ws] = ctx;
  ws.active_set.first_at_bound = state.at_bound;
  ws.active_set.first_servo_force.resize(static_cast<Eigen::Index>(state.at_bound.size()));
  for (std::size_t k = 0; k < state.at_bound.size(); ++k)
    ws.active_set.first_servo_force(static_cast<Eigen::Index>(k)) = ForceOfServo(ctx, k, b);
  ws.active_set.first_slack_side.resize(ws.active_set.slack.size());
  ws.active_set.first_slack_force.resize(static_cast<Eigen::Index>(ws.active_set.slack.size()));
  for (std::size_t k = 0; k < ws.active_set.slack.size(); ++k) {
    ws.active_set.first_slack_side[k] = static_cast<signed char>(ws.active_set.slack[k].side);
    ws.active_set.first_slack_force(static_cast<Eigen::Index>(k)) =
        ForceOfSlack(ctx, ws.active_set.slack[k], b);
  }
}

SaturationChange ComputeSaturationChange(const StepContext& ctx, double b, double onward) {
  const auto& [model, state, ws] = ctx;
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
    if (state.at_bound[k] != ws.active_set.first_at_bound[k])
      add(model.mechanism().force_limits()[k].length,
          ForceOfServo(ctx, k, b) - ws.active_set.first_servo_force(static_cast<Eigen::Index>(k)), true, k);
  for (std::size_t k = 0; k < ws.active_set.slack.size(); ++k)
    if (ws.active_set.slack[k].side != ws.active_set.first_slack_side[k])
      add(model.mechanism().springs()[ws.active_set.slack[k].spring].length,
          ForceOfSlack(ctx, ws.active_set.slack[k], b) -
              ws.active_set.first_slack_force(static_cast<Eigen::Index>(k)),
          false, ws.active_set.slack[k].spring);
  if (out.index < 0) return out;
  const double mass = std::max(model.mechanism().total_mass(), 1e-300);
  ws.scratch.solved = ws.scratch.rhs;
  ws.matrix.factor.SolveInPlace(ws.scratch.solved);
  out.displacement = b * RootOf(ws.scratch.solved.dot(ws.scratch.rhs) / mass);
  ws.scratch.solved.noalias() = ws.mass.M * ws.x;
  out.motion = b * RootOf(ws.x.dot(ws.scratch.solved) / mass);
  return out;
}

bool UpdateForceLimits(const StepContext& ctx, double h) {
  const auto& [model, state, ws] = ctx;
  const auto& limits = model.mechanism().force_limits();
  bool changed = false;
  for (std::size_t k = 0; k < limits.size(); ++k) {
    signed char& at = state.at_bound[k];
    if (at == MechanismState::kInSolve) continue;
    const signed char side = SideOf(ctx, k, h);
    if (side == at) continue;
    changed = true;
    // A motor's force is known whatever the motion.
    const bool follows = WeightInSolve(limits[k], h) > 0 && model.part_of_bounded_force[k] >= 0;
    at = follows ? MechanismState::kInSolve : side;
  }
  return changed;
}

// How far a length goes from the pose at which ComputeJointForces found it to where its force acts.
double LengthChangeToForceEvaluation(const StepContext& ctx, const Mechanism::Length& length, double h) {
  const auto& [model, state, ws] = ctx;
  const int r = model.size();
  ws.active_set.way = h * (ws.x.tail(r) - ws.stage.v_k.tail(r));
  double way = 0;
  ForEachArm(length, ws.paths(),
             [&](int i, double c) { way += c * ws.Q_now().row(i).dot(ws.active_set.way); });
  return way;
}

namespace {

// What a servo at its bound F holds less than its spring: F ℓ in place of ½ k (ℓ - ℓ*)², f = k (ℓ* - ℓ).
double Beyond(const Mechanism::ForceLimit& limit, double f, double F, double length) {
  return limit.stiffness > 0 ? (f - F) * (f - F) / (2 * limit.stiffness) : (F - f) * length;
}

}  // namespace

double EnergyBeyondBounds(const ConstStepContext& ctx, const Configuration& at) {
  const auto& [model, state, ws] = ctx;
  double energy = 0;
  for (const Mechanism::ForceLimit& limit : model.mechanism().force_limits()) {
    if (!model.mechanism().HasPotential(limit.length)) continue;
    const double length = LengthOf(model.mechanism(), limit.length, at.kinematics, at.q),
                 f = UnboundedForce(ctx, limit, length), F = std::min(std::max(f, limit.lower), limit.upper);
    if (f != F) energy += Beyond(limit, f, F, length);
  }
  return energy;
}

}  // namespace fork1s
