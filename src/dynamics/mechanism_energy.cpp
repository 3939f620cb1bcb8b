// Energy, and the guard that keeps a step from making any.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace fork1s {

double MechanismDynamics::KineticEnergy() const {
  double energy = 0.5 * x_.dot(M_full_ * x_);
  if (mechanism().base() == BaseKind::kDriven) {
    Matrix6 M_00 = model_.M_00;
    Matrix6X M_0z = model_.M_0z;
    if (options_.recovery == Recovery::kExact) {
      BaseInertia(mechanism(), configuration_.kinematics, M_00, M_0z);
      M_0z = (M_0z * Q_now()).eval();
    }
    energy += state_.V_R.dot(M_0z * state_.w) + 0.5 * state_.V_R.dot(M_00 * state_.V_R);
  }
  return energy;
}

double MechanismDynamics::PotentialEnergy(const Vector3& gravity_W) const {
  const Mechanism& m = mechanism();
  double energy = 0;
  if (options_.recovery == Recovery::kTwist) {
    // Springs in the coordinates that the twist mode integrates.
    energy = 0.5 * state_.z.dot(model_.K_r.cwiseProduct(state_.z)) - f_ref_.dot(state_.z);
  } else {
    energy = SpringEnergy(m, configuration_.kinematics, configuration_.q);
  }
  for (std::size_t i = 0; i < m.controls().size(); ++i) {
    const auto& control = m.controls()[i];
    const double u = controls_(static_cast<Eigen::Index>(i));
    for (const auto& [k, c] : control.terms) energy -= control.gain * u * c * configuration_.q(k);
    if (m.definition().controls[i].is_setpoint) energy += 0.5 * control.gain * u * u;
  }
  for (int b = 0; b < m.num_bodies(); ++b) {
    const SpatialInertia& I = m.bodies()[static_cast<std::size_t>(b)].inertia_B;
    if (I.mass > 0) energy -= I.mass * gravity_W.dot(BodyPose(BodyIndex(b)) * I.center);
  }
  return energy;
}

// Velocity forces are explicit and, on a fixed base, M is that of the reference: fast motion could feed on
// either. What a step gained beyond what contact put in is taken from the motion relative to the locked
// mechanism, which leaves the momentum of a floating base as it is.
void MechanismDynamics::GuardEnergy() {
  const double excess = KineticEnergy() + PotentialEnergy(gravity_W_) - energy_budget_;
  if (!(excess > 0)) return;
  momentum_.noalias() = M_full_ * x_;
  double relative = 0.5 * x_.dot(momentum_);
  Vector6 locked = Vector6::Zero();
  if (base_size_ > 0) {
    // KE = KE_locked + s² KE_relative, without a mixed term, since the relative motion carries no base
    // momentum.
    locked = M_00_.llt().solve(momentum_.head<6>());
    relative -= 0.5 * locked.dot(M_00_ * locked);
  }
  if (!(relative > 0)) return;
  const double s = std::sqrt(std::max(0.0, 1 - excess / relative));
  x_.tail(model_.size()) *= s;
  state_.w = x_.tail(model_.size());
  if (base_size_ == 0) return;
  x_.head<6>() = locked + s * (x_.head<6>() - locked);
  state_.V_R = x_.head<6>();
}

}  // namespace fork1s
