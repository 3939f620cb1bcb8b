// The step of second order in lasting contact: docs/method.md, section 5.
//
// All forces act at the end of the step, where contacts are found as well, and the past step makes that a rule
// of second order (the backward differentiation formula of two steps): with a = 3/2
//     w⁺ = a x,   z⁺ = z + h (x + s),   s = (z - z⁻)/3h                      z⁻: before the past step
//     M_e (w⁺ - u) = (h/a) f(z⁺) + J_eᵀλ/a,   u = M_e⁻¹ J_eᵀ (4 ẋ - ẋ⁻)/3
// so that the unknown x, which with s is how far the step goes, obeys
//     (a² M + a h D + h² K) x = a M u + h f(z_e) - h K (z + h s - z_e) + J_eᵀλ
// e is the pose that two steps lead to, z_e = z⁻ + 2 h w: off from z⁺ by the third order. A step that follows
// a jump knows nothing of the past: a = 1, s = 0, z_e = z + h w, which is implicit Euler with forces and
// contacts at its end. ẋ, ẋ⁻ are as in theta_step.cpp, each turned freely to the end of the step.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <limits>

namespace fork1s {

// What the next step will know of this one: all but how far it goes. start_velocity_ is that of the start.
void MechanismDynamics::KeepPast(double h) {
  past_next_.h = h;
  past_next_.q_dot = q_dot_start_;
  past_next_.c_dot_W.noalias() = state_.reduced.X_WR.rotation() * start_velocity_.c_dot;
  past_next_.omega = start_velocity_.omega;
  past_next_.R_WR = state_.reduced.X_WR.rotation();
}

// A base's twist about its frame, by the velocity of the whole's centre of mass in its axes and the rates of
// the reduced coordinates.
Vector6 MechanismDynamics::BaseTwist(const Vector3& omega, const Vector3& center_velocity,
                                     const Eigen::Ref<const VectorX>& rates) const {
  Vector6 V;
  V.head<3>() = omega;
  Vector3 momentum = M_full_.block<3, 3>(3, 0) * omega;
  for (Eigen::Index i = 0; i < rates.size(); ++i) momentum += rates(i) * M_0z_.col(i).tail<3>();
  V.tail<3>() = center_velocity - momentum / M_00_(5, 5);
  return V;
}

// To the pose at which the step is foreseen to end, and how far it will have gone beside x by then.
void MechanismDynamics::MoveToEnd(double h) {
  const int r = model().size();
  const bool two = state_.past.h == h;
  order_ = two ? 1.5 : 1;
  const RigidTransform X_start = state_.reduced.X_WR;
  std::swap(configuration_, elsewhere_);
  configuration_.TakeLoops(elsewhere_);
  moved_.setZero(num_velocities());
  contact_shift_.setZero(num_velocities());
  if (r > 0) {
    moved_.tail(r) = state_.reduced.w;
    if (two) {
      moved_.tail(r) += state_.reduced.w - state_.past.z_moved / h;
      contact_shift_.tail(r) = state_.past.z_moved / (3 * h);
    }
    state_.reduced.z += h * moved_.tail(r);
  }
  Vector3 turn = Vector3::Zero(), way = Vector3::Zero();
  if (mechanism().base() == BaseKind::kDriven) {
    const Vector6 V_last = state_.reduced.V_R;
    state_.reduced.V_R = DrivenTwist(h);
    V_end_ = two ? Vector6(1.5 * state_.reduced.V_R - 0.5 * V_last) : state_.reduced.V_R;
    state_.reduced.X_WR = state_.driven_next;
  }
  if (base_size_ > 0) {
    turn = h * state_.reduced.V_R.head<3>();
    way = h / M_00_(5, 5) * linear_W_;
    if (two) {
      turn = 2 * turn - LogRotation(state_.past.R_WR.transpose() * X_start.rotation());
      way = 2 * way - (center_W_ - state_.past.center_W);
    }
    state_.reduced.X_WR.rotation() = X_start.rotation() * ExpRotation(turn);
  }
  UpdateConfiguration();
  if (base_size_ > 0) {
    const Matrix3& R = state_.reduced.X_WR.rotation();
    const Matrix3 R_eW = R.transpose();
    state_.reduced.X_WR.translation() =
        center_W_ + way - R * CenterOfParts(rigid_parts_, configuration_.kinematics);
    moved_.head<6>() = BaseTwist(turn / h, R_eW * way / h, moved_.tail(r));
    if (two) {
      const Vector3 before = LogRotation(R_eW * state_.past.R_WR);
      contact_shift_.head<6>() = BaseTwist((-turn - before) / (3 * h),
                                           R_eW * (center_W_ - state_.past.center_W) / (3 * h),
                                           contact_shift_.tail(r));
    }
  }
  x_ = moved_;
}

// start_velocity_ and q_dot_mixed_: (4 ẋ - ẋ⁻)/3, each as it is at the end of the step if nothing acts.
void MechanismDynamics::MixPast(double h) {
  TurnFreely(rigid_parts_, h, start_velocity_);
  q_dot_mixed_ = q_dot_start_;
  if (!(order_ > 1)) return;
  const MechanismPast& past = state_.past;
  other_velocity_.c_dot.noalias() = X_WR_before_.rotation().transpose() * past.c_dot_W;
  other_velocity_.omega = past.omega;
  TurnFreely(rigid_parts_, 2 * h, other_velocity_);
  start_velocity_.c_dot = (4 * start_velocity_.c_dot - other_velocity_.c_dot) / 3;
  start_velocity_.omega = (4 * start_velocity_.omega - other_velocity_.omega) / 3;
  q_dot_mixed_ = (4 * q_dot_start_ - past.q_dot) / 3;
}

RigidTransform MechanismDynamics::GroupPoseAtStart(int g) const {
  return X_WR_before_ * elsewhere_.kinematics.X_RB[groups_[static_cast<std::size_t>(g)].body.u()];
}

// x before contact, from u_ and the forces at hand.
void MechanismDynamics::SolveFreeEnd(double h) {
  const int r = model().size();
  all_at_end_ = true;
  if (HasSwitches()) AddSwitchedForces();
  if (num_velocities() == 0) return;
  impulse_.setZero(num_velocities());
  A_ = order_ * order_ * M_full_;
  x_ = order_ * momentum_;
  if (base_size_ > 0) x_.head<6>() += h * base_force_;
  if (r > 0) {
    auto A_z = A_.bottomRightCorner(r, r);
    A_z += order_ * h * model().D;
    A_z.diagonal() += h * h * model().K_r;
    f_used_ = z_before_ - state_.reduced.z + h * contact_shift_.tail(r);
    SpringPull(f_used_, f_turn_);
    x_.tail(r) += h * (f_z_ + f_turn_);
    TakeBoundedSpringsOut(h);
  }
  if (factor_.Compute(A_))
    factor_.SolveInPlace(x_);
  else  // World::Step finds it, takes the step back and reports
    x_.setConstant(std::numeric_limits<double>::quiet_NaN());
}

void MechanismDynamics::IntegrateEnd(double h) {
  const int r = model().size();
  const Matrix3 R_e = state_.reduced.X_WR.rotation();
  w_mean_ = x_.tail(r) + contact_shift_.tail(r);
  state_.reduced.z = z_before_ + h * w_mean_;
  Vector3 center = Vector3::Zero();
  if (base_size_ > 0) {
    rhs_ = x_ + contact_shift_;
    const Vector3 momentum = M_full_.middleRows<3>(3) * rhs_;
    center = center_W_ + h / M_00_(5, 5) * (R_e * momentum);
    state_.reduced.X_WR.rotation() = R_e * ExpRotation(h * (rhs_.head<3>() - moved_.head<3>()));
    state_.reduced.X_WR.Orthonormalize();
  }
  // ẋ⁺, seen from where it was found.
  Vector6 V = Vector6::Zero();
  if (mechanism().base() == BaseKind::kDriven) V = V_end_;
  if (base_size_ > 0) V = order_ * x_.head<6>();
  q_ddot_.setZero();
  if (r > 0) {
    f_turn_ = order_ * x_.tail(r);
    q_ddot_.noalias() = Q_now() * f_turn_;
  }
  ComputeMaterialVelocities(mechanism(), rigid_parts_, configuration_.kinematics, q_ddot_, V, start_velocity_);

  pose_energy_.valid = false;
  Configure(model(), state_.reduced, configuration_);
  UpdateInertia();
  if (base_size_ > 0)
    state_.reduced.X_WR.translation() =
        center - state_.reduced.X_WR.rotation() * CenterOfParts(rigid_parts_, configuration_.kinematics);
  F_parts_.setZero();
  AddMomentum(rigid_parts_, configuration_.kinematics, start_velocity_,
              state_.reduced.X_WR.rotation().transpose() * R_e, 1, F_parts_);
  tau_ = mechanism().armature().cwiseProduct(q_ddot_);
  if (mechanism().base() == BaseKind::kDriven) {
    q_ddot_.setZero();
    ComputeMaterialVelocities(mechanism(), rigid_parts_, configuration_.kinematics, q_ddot_, V_end_,
                              other_velocity_);
    AddMomentum(rigid_parts_, configuration_.kinematics, other_velocity_, Matrix3::Identity(), -1, F_parts_);
  }
  GatherFromParts(mechanism(), configuration_.kinematics.S, F_parts_, tau_);
  q_dot_ = q_dot_start_;  // ClosureForces takes the rate of joint rates from it
  TakeVelocityAtEnd(0);
  past_next_.z_moved = state_.reduced.z - z_before_;
  past_next_.V_R = V_end_;
  std::swap(state_.past, past_next_);
}

}  // namespace fork1s
