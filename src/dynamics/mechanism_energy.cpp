// Energy.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

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
  return PotentialOfSprings(X_WR, gravity_W) - EnergyBeyondBounds();
}

double MechanismDynamics::PotentialOfSprings(const RigidTransform& X_WR, const Vector3& gravity_W) const {
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
  return energy;
}

}  // namespace fork1s
