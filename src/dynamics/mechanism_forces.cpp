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

// f_z_ and base_force_ at the present pose; q_perp follows the loads of this pose.
void MechanismDynamics::LoadForces(double h, const Vector3& gravity_R, const Vector6& A_R) {
  const Mechanism& m = mechanism();
  momentum_rate_.setZero();
  if (options_.recovery == Recovery::kTwist) {
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
    if (state_.has_wrenches)
      for (int b = 0; b < m.num_bodies(); ++b) {
        const Vector6 F = AdjointTransposeApply(state_.reduced.X_WR, state_.wrenches_W.col(b));
        f_z_.noalias() += model().T_of(BodyIndex(b)).transpose() * F;
        base_force_ += F;
      }
    return;
  }
  F_.setZero();
  if (!gravity_R.isZero(0)) AddGravityWrenches(m, configuration_.kinematics, gravity_R, F_);
  if (state_.has_wrenches)
    for (int b = 0; b < m.num_bodies(); ++b)
      F_.col(b) += AdjointTransposeApply(state_.reduced.X_WR, state_.wrenches_W.col(b));
  tau_.setZero();
  // The base's own rows get the same by carrying its momentum along, and momentum_rate_.
  if (base_moves()) base_force_ = F_.rowwise().sum();
  q_dot_.setZero();
  AddMotion(model(), Q_now(), state_.reduced.w, q_dot_);
  const bool by_formula =
      rule_ == StepRule::kEuler;  // else velocity forces come of the momentum carried along
  const bool turns = base_moves() && !state_.reduced.V_R.isZero(0);
  // What rests drifts by less than this; its velocity forces would be below 1e-12 of its inertia.
  constexpr double kRests = 1e-6;  // rad/s or m/s
  const bool moves = q_dot_.lpNorm<Eigen::Infinity>() > kRests;
  q_ddot_.setZero();
  if (by_formula && moves && state_.q_dot.size() > 0) {
    // Loops turn Q as they move: of the joint rates that the last step left the motions of this pose keep
    // what they can, Qᵀ M (Q w⁺ - q̇) = h f, and that never adds energy. Ȧ q̇ in closed form would be of second
    // order, and blows up where loops are nearly singular.
    q_ddot_ = (q_dot_ - state_.q_dot) / h;
    tau_ -= m.armature().cwiseProduct(q_ddot_);
  }
  if (by_formula && (turns || moves))
    SubtractVelocityWrenches(m, configuration_.kinematics, configuration_.q, state_.reduced.V_R, q_dot_,
                             q_ddot_, body_V_, body_A_, F_);
  if (!A_R.isZero(0)) SubtractRigidMotionWrenches(m, configuration_.kinematics, Vector6::Zero(), A_R, F_);
  AccumulateGeneralizedForce(m, configuration_.kinematics.S, F_, tau_);
  // The velocity wrenches of all bodies together are -(Ṁ x - ad(ξ)ᵀ p), p = M x the base's momentum.
  if (by_formula && base_size_ > 0)
    momentum_rate_ = base_force_ - F_.col(0) +
                     SmallAdjoint(state_.reduced.V_R).transpose() *
                         (M_00_ * state_.reduced.V_R + M_0z_ * state_.reduced.w);
  if (state_.controls.size() > 0) AddControlForce(m, configuration_.kinematics, state_.controls, tau_);
  SpringForce(m, configuration_.kinematics, configuration_.q, g_);
  g_ += tau_;
  if (model().has_complement) FollowLoads();
  ReduceForce(model(), Q_now(), g_, f_z_);
}

// The interior's own displacement, one step of Newton with the stiffness of the reference towards rest under
// g_, all joint forces of the present pose. On trees with linear springs that is C_perp (loads) exactly.
// Loops turn with the pose: without their projector, reactions that are large and almost balanced would pass
// for loads. Nor is the inertia of changing joint rates among them: they are known as a difference over one
// step, the displacement turns the loops in its turn, and short steps would feed that back on itself.
void MechanismDynamics::FollowLoads() {
  rest_ = g_;
  if (!q_ddot_.isZero(0)) {
    ApplyMass(mechanism(), configuration_.kinematics, q_ddot_, inertial_);
    rest_ += inertial_;
  }
  ProjectOnLoops(model(), configuration_, rest_);
  ApplyComplement(model(), rest_, q_perp_step_);
  // First loads after a refresh: what they ask for at once is kept back and fades, so that nothing jumps.
  if (state_.q_perp_offset.size() == 0) {
    state_.q_perp_offset = q_perp_step_;
    state_.q_perp_step_last.setZero(q_perp_step_.size());
    state_.follow = 1;
    state_.overshoots = 0;
  }
  q_perp_step_ -= state_.q_perp_offset;
  // Loads that stiffen the interior to more than twice its springs, a rope under tension, make such steps
  // overshoot by more each time. Then they are shortened, until the next refresh.
  constexpr double kShortest = 1.0 / 16;
  const bool overshoots =
      q_perp_step_.dot(state_.q_perp_step_last) < -0.81 * state_.q_perp_step_last.squaredNorm();
  state_.overshoots = overshoots ? state_.overshoots + 1 : 0;
  if (state_.overshoots >= 2 && state_.follow > kShortest) {  // once is what a load that turns round does too
    state_.follow /= 2;
    state_.overshoots = 0;
  }
  state_.reduced.q_perp += state_.follow * q_perp_step_;
  state_.q_perp_step_last = q_perp_step_;
}

}  // namespace fork1s
