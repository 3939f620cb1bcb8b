// Energy, and the guard that keeps a step from making any.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <algorithm>
#include <cmath>
#include <fork1s/linalg/cholesky.hpp>
#include <fork1s/recovery/recover.hpp>

namespace fork1s {

double MechanismDynamics::KineticEnergy() const {
  double energy = 0;
  // By columns, so that no product has to be kept.
  for (Eigen::Index i = 0; i < x_.size(); ++i) energy += 0.5 * x_(i) * M_full_.col(i).dot(x_);
  if (mechanism().base() == BaseKind::kDriven)
    energy += state_.reduced.V_R.dot(M_0z_ * state_.reduced.w) +
              0.5 * state_.reduced.V_R.dot(M_00_ * state_.reduced.V_R);
  return energy;
}

// What depends on the pose alone; a step asks for it at its start and end, and poses change once.
const MechanismDynamics::PoseEnergy& MechanismDynamics::EnergyOfPose() const {
  if (pose_energy_.valid) return pose_energy_;
  const Mechanism& m = mechanism();
  const bool twist = options_.recovery == Recovery::kTwist;
  if (twist) {
    // Springs in the coordinates that the twist mode integrates.
    pose_energy_.springs = springs_ref_ +
                           0.5 * state_.reduced.z.dot(model().K_r.cwiseProduct(state_.reduced.z)) -
                           f_ref_.dot(state_.reduced.z);
  } else {
    pose_energy_.springs = SpringEnergy(m, configuration_.kinematics, configuration_.q);
  }
  pose_energy_.moment.setZero();
  for (int b = 0; b < m.num_bodies(); ++b) {
    const Mechanism::Body& body = m.bodies()[static_cast<std::size_t>(b)];
    if (body.weighed_mass == 0) continue;
    const RigidTransform X_RB = twist ? RecoverPoseTwist(model(), state_.reduced, BodyIndex(b))
                                      : configuration_.kinematics.X_RB[std::size_t(b)];
    pose_energy_.moment += body.weighed_mass * (X_RB * body.inertia_B.center);
  }
  pose_energy_.valid = true;
  return pose_energy_;
}

double MechanismDynamics::PotentialEnergy(const Vector3& gravity_W) const {
  return PotentialEnergyOn(state_.reduced.X_WR, gravity_W);
}

double MechanismDynamics::PotentialEnergyOn(const RigidTransform& X_WR, const Vector3& gravity_W) const {
  const Mechanism& m = mechanism();
  const PoseEnergy& pose = EnergyOfPose();
  double energy =
      pose.springs - gravity_W.dot(m.weighed_mass() * X_WR.translation() + X_WR.rotation() * pose.moment);
  for (std::size_t i = 0; i < m.controls().size(); ++i) {
    const auto& control = m.controls()[i];
    if (!m.HasPotential(control.length)) continue;
    const double u = state_.controls(static_cast<Eigen::Index>(i));
    energy -= control.gain * u * Length(control.length);
    if (m.definition().controls[i].is_setpoint) energy += 0.5 * control.gain * u * u;
  }
  return energy - EnergyBeyondBounds();
}

// The motion relative to the locked mechanism is scaled by s: what a floating base carries of momentum stays.
void MechanismDynamics::ScaleRelativeMotion(double s) {
  const int r = model().size();
  if (base_size_ > 0) {
    momentum_.noalias() = M_full_ * x_;
    const Vector6 locked = SolvePositive(M_00_, momentum_.head<6>());
    x_.head<6>() = locked + s * (x_.head<6>() - locked);
    state_.reduced.V_R = x_.head<6>();
  }
  x_.tail(r) *= s;
  state_.reduced.w = x_.tail(r);
  state_.q_dot *= s;
}

// Velocity forces are explicit, loops bend the springs within a step and a long mechanism keeps the M of its
// reference: fast motion could feed on each. What a step gained beyond what contact put in is taken from the
// velocity. False if the velocity held less than that.
bool MechanismDynamics::TakeExcessEnergy() {
  const double kinetic = KineticEnergy(), potential = PotentialEnergy(gravity_W_);
  const double excess = kinetic + potential - energy_budget_;
  // Both energies are sums of many terms; below their rounding there is nothing to take.
  constexpr double kRounding = 1e-14;
  if (!(excess > kRounding * (kinetic + std::abs(potential) + std::abs(energy_budget_)))) return true;
  momentum_.noalias() = M_full_ * x_;
  // KE = KE_locked + s² KE_relative, without a mixed term: relative motion carries no base momentum.
  double relative = 0.5 * x_.dot(momentum_);
  if (base_size_ > 0) relative -= 0.5 * momentum_.head<6>().dot(SolvePositive(M_00_, momentum_.head<6>()));
  if (!(relative > 0)) return false;
  ScaleRelativeMotion(std::sqrt(std::max(0.0, 1 - excess / relative)));
  return excess <= relative;
}

// Springs came to hold more than there was: the relative motion of this step is shortened to where they do
// not.
void MechanismDynamics::TakeShorterStep(double h) {
  auto advance = [&](double s) {
    AdvanceShortened(h, s);
    return TakeExcessEnergy();
  };
  double fits = 0, tried = 0.5;
  bool last = false;
  // A turning point between two steps needs no more digits than this.
  constexpr int kHalvings = 10;
  for (int i = 0; i < kHalvings; ++i) {
    last = advance(tried);
    const double half = std::ldexp(0.25, -i);
    if (last) fits = tried;
    tried += last ? half : -half;
  }
  if (!last) advance(fits);
}

}  // namespace fork1s
