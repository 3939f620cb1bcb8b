// Servos and motors that can give no more.
//
// The spring of a servo stands in A = M + hD + h²K, and its force at the end of the step is
//     f = f₀ - (h k + d) eᵀx,   f₀ = Σ share gain u + k (rest - ℓ),   dℓ/dt = eᵀx
// Where that is beyond a bound F, the servo pushes with F whatever the motion: its spring leaves A, and F
// takes the place of f₀:
//     A' = A - h (h k + d) e eᵀ,   rhs' = rhs + h (F - f₀) e
// Which servos are at a bound follows from the velocity with contact, so the step solves, looks, and solves
// again until none changes: Newton's method on a force that is piecewise linear in the velocity and never
// grows with it.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <cmath>

namespace fork1s {
namespace {

double Dot(const Mechanism::LinearForm& terms, const VectorX& values) {
  double sum = 0;
  for (const auto& [i, c] : terms) sum += c * values(i);
  return sum;
}

}  // namespace

double MechanismDynamics::UnboundedForce(const Mechanism::ForceLimit& limit) const {
  return Dot(limit.inputs, state_.controls) + limit.stiffness * (limit.rest - Length(limit.length));
}

void MechanismDynamics::SizeForceLimits() {
  const auto count = mechanism().force_limits().size();
  state_.at_bound.resize(count, 0);
  limit_force_.resize(static_cast<Eigen::Index>(count));
  limit_row_.resize(model().size());
}

void MechanismDynamics::OpenForceLimits() {
  const auto& limits = mechanism().force_limits();
  for (std::size_t k = 0; k < limits.size(); ++k)
    limit_force_(static_cast<Eigen::Index>(k)) = UnboundedForce(limits[k]);
  // A holds the springs of those that were at a bound in the last step no longer.
  if (AnyAtBound()) factored_h_ = -1;
}

bool MechanismDynamics::AnyAtBound() const {
  return std::any_of(state_.at_bound.begin(), state_.at_bound.end(),
                     [](signed char side) { return side != 0; });
}

bool MechanismDynamics::ServosTurn() const {
  return model().loop_rank() > 0 && ActsAtPose();
}

// Loops turn Q as the pose moves, and the spring that A has at the reference with it. Elsewhere that does not
// matter: what the step leaves of it is in the next step's f₀. Here f at the end of the step decides, and of
// a stiff servo (1e9 N/m) the few per cent of the motion that the turn makes are more than its bound.
void MechanismDynamics::TurnServos(double h) {
  if (!ServosTurn()) return;
  for (const Mechanism::ForceLimit& limit : mechanism().force_limits()) {
    const double spring = h * h * limit.stiffness;
    if (!(spring > 0)) continue;
    AddSpringOf(limit.length, -spring, false);
    AddSpringOf(limit.length, spring, true);
  }
}

void MechanismDynamics::TakeBoundedSpringsOut(double h) {
  const auto& limits = mechanism().force_limits();
  for (std::size_t k = 0; k < limits.size(); ++k) {
    const double weight = h * h * limits[k].stiffness + order_ * h * limits[k].damping;
    if (state_.at_bound[k] != 0 && weight > 0) AddSpringOf(limits[k].length, -weight, ServosTurn());
  }
}

void MechanismDynamics::OpenSwitches() {
  f_z_of_springs_ = f_z_;
  OpenForceLimits();
  OpenSlackSprings();
}

bool MechanismDynamics::UpdateSwitches(double h) {
  const bool bounds = UpdateForceLimits(h), slack = UpdateSlackSprings(h);
  return bounds || slack;
}

void MechanismDynamics::AddSwitchedForces() {
  const auto& limits = mechanism().force_limits();
  f_z_ = f_z_of_springs_;
  AddSlackForces();
  for (std::size_t k = 0; k < limits.size(); ++k) {
    if (state_.at_bound[k] == 0) continue;
    const double bound = state_.at_bound[k] > 0 ? limits[k].upper : limits[k].lower;
    ReducedRow(limits[k].length, Paths(), Q_now(), limit_row_);
    f_z_ += (bound - limit_force_(static_cast<Eigen::Index>(k))) * limit_row_;
  }
}

bool MechanismDynamics::UpdateForceLimits(double h) {
  const auto& limits = mechanism().force_limits();
  bool changed = false;
  for (std::size_t k = 0; k < limits.size(); ++k) {
    const double f = limit_force_(static_cast<Eigen::Index>(k)) -
                     limits[k].stiffness * WayToForce(limits[k].length, h) -
                     limits[k].damping * order_ * LengthRate(limits[k].length);
    signed char side = f > limits[k].upper ? 1 : f < limits[k].lower ? -1 : 0;
    if (side * state_.at_bound[k] < 0)
      side = 0;  // between the two it gives less: leaping over that they take turns
    changed = changed || side != state_.at_bound[k];
    state_.at_bound[k] = side;
  }
  if (changed) factored_h_ = -1;
  return changed;
}

// How far a length goes from the pose at which LoadForces found it to where its force acts.
double MechanismDynamics::WayToForce(const Mechanism::Length& length, double h) {
  const int r = model().size();
  if (options_.recovery == Recovery::kTwist) return h * LengthRate(length);
  if (rule_ != StepRule::kMiddle) {
    f_used_ = h * (x_.tail(r) + contact_shift_.tail(r));
  } else {
    f_turn_ = x_.tail(r) + u_.tail(r) - 2 * w_start_;
    w_mean_.noalias() = scheme().Th * f_turn_;
    w_mean_ += w_start_;
    f_used_ = z_before_ - state_.reduced.z;
    f_used_.noalias() += h * (scheme().Th * w_mean_);
  }
  double way = 0;
  ForEachArm(length, Paths(), [&](int i, double c) { way += c * Q_now().row(i).dot(f_used_); });
  return way;
}

// Force of the reduced springs at z = `moved`, those of servos at their bounds left out.
void MechanismDynamics::SpringPull(const VectorX& moved, VectorX& force) {
  force = -model().K_r.cwiseProduct(moved);
  if (TakesBentSprings()) force.noalias() -= K_beyond_ * moved;
  for (std::size_t k = 0; k < state_.at_bound.size(); ++k) {
    if (state_.at_bound[k] == 0) continue;
    const Mechanism::ForceLimit& limit = mechanism().force_limits()[k];
    if (ServosTurn() || (limit.length.path >= 0 && ActsAtPose()))
      ReducedRow(limit.length, Paths(), Q_now(), limit_row_);
    else
      ReducedRow(limit.length, paths_ref_, model().Q_rows, limit_row_);
    force += limit.stiffness * limit_row_.dot(moved) * limit_row_;
  }
}

namespace {

// What a servo at its bound F holds less than its spring: F ℓ in place of ½ k (ℓ - ℓ*)², f = k (ℓ* - ℓ).
double Beyond(const Mechanism::ForceLimit& limit, double f, double F, double length) {
  return limit.stiffness > 0 ? (f - F) * (f - F) / (2 * limit.stiffness) : (F - f) * length;
}

}  // namespace

double MechanismDynamics::EnergyBeyondBounds() const {
  double energy = 0;
  for (const Mechanism::ForceLimit& limit : mechanism().force_limits()) {
    if (!mechanism().HasPotential(limit.length)) continue;
    const double f = UnboundedForce(limit), F = std::min(std::max(f, limit.lower), limit.upper);
    if (f != F) energy += Beyond(limit, f, F, Length(limit.length));
  }
  return energy;
}

// A servo gives its bound for its damper's sake too, which no potential of the pose knows of. To a step its
// force is that of a spring or the bound, whichever it took, from start to end.
template <typename Pose>
double MechanismDynamics::BeyondBoundsTaken(const Pose& pose) const {
  double energy = 0;
  const auto& limits = mechanism().force_limits();
  for (std::size_t k = 0; k < limits.size(); ++k) {
    if (state_.at_bound[k] == 0 || !mechanism().HasPotential(limits[k].length)) continue;
    const auto [f, length] = pose(k);
    energy += Beyond(limits[k], f, state_.at_bound[k] > 0 ? limits[k].upper : limits[k].lower, length);
  }
  return energy;
}

void MechanismDynamics::KeepBoundedLengths() {
  const auto& limits = mechanism().force_limits();
  limits_start_.resize(limits.size());
  for (std::size_t k = 0; k < limits.size(); ++k)
    limits_start_[k] = {UnboundedForce(limits[k]), Length(limits[k].length)};
}

double MechanismDynamics::BeyondBoundsAtStart() const {
  return BeyondBoundsTaken([this](std::size_t k) { return limits_start_[k]; });
}

double MechanismDynamics::PotentialOfStep(const RigidTransform& X_WR) const {
  return PotentialOfSprings(X_WR, gravity_W_) - BeyondBoundsTaken([this](std::size_t k) {
           const Mechanism::ForceLimit& limit = mechanism().force_limits()[k];
           return std::pair(UnboundedForce(limit), Length(limit.length));
         });
}

}  // namespace fork1s
