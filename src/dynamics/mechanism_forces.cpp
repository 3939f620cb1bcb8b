// Springs, controls, gravity, wrenches and velocity forces of the present pose, in reduced coordinates.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

namespace fork1s {

void MechanismDynamics::TakeReferenceForces() {
  const Mechanism& m = mechanism();
  Kinematics kinematics(m);
  ComputeKinematics(m, model().q_ref, kinematics);
  paths_ref_ = kinematics.paths;
  spring_stiffness_ref_.clear();
  has_bent_springs_ = false;
  for (const Mechanism::Spring& s : m.springs()) {
    spring_stiffness_ref_.push_back(s.StiffnessAt(LengthOf(m, s.length, kinematics, model().q_ref)));
    has_bent_springs_ = has_bent_springs_ || s.length.path >= 0 || !s.is_linear();
  }
  FindSlackSprings();
  FindFollowers();
  stiffness_ref_.resize(0, 0);
  if (model().has_complement && !m.has_diagonal_stiffness())
    stiffness_ref_ = StiffnessMatrix(m, kinematics, model().q_ref);
  if (options_.recovery != Recovery::kTwist) return;
  configuration_.kinematics.paths = kinematics.paths;
  VectorX g_ref(model().num_coordinates());  // spring forces at the reference
  SpringForce(m, kinematics, model().q_ref, g_ref);
  springs_ref_ = SpringEnergy(m, kinematics, model().q_ref);
  const int r = model().size();
  f_ref_ = model().Q.transpose() * g_ref;
  gravity_map_.resize(r, 3);
  base_gravity_map_.resize(6, 3);
  for (int axis = 0; axis < 3; ++axis) {
    F_.setZero();
    tau_.setZero();
    AddGravityWrenches(m, kinematics, Vector3::Unit(axis), F_);
    AccumulateGeneralizedForce(m, kinematics.S, F_, tau_);
    gravity_map_.col(axis) = model().Q.transpose() * tau_;
    base_gravity_map_.col(axis) = F_.col(0);
  }
  const auto controls = m.controls().size();
  if (base_moves()) {
    // ξ x* (I ξ) is quadratic in ξ: its symmetric coefficients by polarisation.
    auto force = [&](const Vector6& V) {
      F_.setZero();
      tau_.setZero();
      SubtractRigidMotionWrenches(m, kinematics, V, Vector6::Zero(), F_);
      AccumulateGeneralizedForce(m, kinematics.S, F_, tau_);
      return VectorX(model().Q.transpose() * tau_);
    };
    rigid_motion_map_.resize(r, 36);
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j)
        rigid_motion_map_.col(6 * i + j) = 0.5 * (force(Vector6::Unit(i) + Vector6::Unit(j)) -
                                                  force(Vector6::Unit(i)) - force(Vector6::Unit(j)));
  }
  control_map_.resize(r, static_cast<Eigen::Index>(controls));
  for (std::size_t i = 0; i < controls; ++i) {
    tau_.setZero();
    AddControlForce(m, kinematics,
                    VectorX::Unit(static_cast<Eigen::Index>(controls), static_cast<Eigen::Index>(i)), tau_);
    control_map_.col(static_cast<Eigen::Index>(i)) = model().Q.transpose() * tau_;
  }
}

// The same by twists, all of the reference.
void MechanismDynamics::LoadForcesTwist(const Vector3& gravity_R, const Vector6& A_R) {
  f_z_ = f_ref_;
  f_z_ -= model().K_r.cwiseProduct(state_.reduced.z);
  f_z_.noalias() += gravity_map_ * gravity_R;
  if (state_.controls.size() > 0) f_z_.noalias() += control_map_ * state_.controls;
  base_force_.noalias() = base_gravity_map_ * gravity_R;
  if (base_moves()) {
    f_z_.noalias() -= model().M_0z.transpose() * A_R;
    const Matrix6 VV = state_.reduced.V_R * state_.reduced.V_R.transpose();
    f_z_.noalias() += rigid_motion_map_ * Eigen::Map<const Eigen::Matrix<double, 36, 1>>(VV.data());
  }
  if (!state_.has_wrenches) return;
  for (int b = 0; b < mechanism().num_bodies(); ++b) {
    const Vector6 F = AdjointTransposeApply(state_.reduced.X_WR, state_.wrenches_W.col(b));
    f_z_.noalias() += model().T_of(BodyIndex(b)).transpose() * F;
    base_force_ += F;
  }
}

// g_, all joint forces of the present pose, and base_force_. Velocity forces are none of them: they come of the
// momentum that is carried along.
void MechanismDynamics::LoadForces(const Vector3& gravity_R) {
  const Mechanism& m = mechanism();
  F_.setZero();
  if (!gravity_R.isZero(0)) AddGravityWrenches(m, configuration_.kinematics, gravity_R, F_);
  if (state_.has_wrenches)
    for (int b = 0; b < m.num_bodies(); ++b)
      F_.col(b) += AdjointTransposeApply(state_.reduced.X_WR, state_.wrenches_W.col(b));
  tau_.setZero();
  if (base_moves()) base_force_ = F_.rowwise().sum();
  AccumulateGeneralizedForce(m, configuration_.kinematics.S, F_, tau_);
  if (state_.controls.size() > 0) AddControlForce(m, configuration_.kinematics, state_.controls, tau_);
  SpringForce(m, configuration_.kinematics, configuration_.q, g_);
  g_ += tau_;
}

}  // namespace fork1s
