// The step of second order in lasting contact: docs/method.md, section 5.
//
// Implicit Euler that knows the past step: the backward differentiation formula of two steps. With a = 3/2
//     w⁺ = a x,   z⁺ = z + h (x + s),   s = (z - z⁻)/3h                      z⁻: before the past step
//     M (w⁺ - u) = (h/a) f(z⁺) + Jᵀλ/a,   u = M⁻¹ Jᵀ (4 ẋ - ẋ⁻)/3
// so that the unknown x, which with s is how far the step goes, obeys
//     (a² M + a h D + h² K) x = a M u + h f(z) - h² K s + Jᵀλ
// and contacts are rows of x + s as they are rows of the end velocity of implicit Euler, found where that
// finds them. A step that follows an impact knows nothing of the past: a = 1, s = 0. ẋ, ẋ⁻ are as in
// theta_step.cpp, ẋ⁻ turned freely to here.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <limits>

namespace fork1s {

// What the next step will know of this one: all but how far it goes. start_velocity_ is that of the start.
void MechanismDynamics::KeepPast(double h) {
  if (rule_ == StepRule::kEuler) return;
  past_next_.h = h;
  past_next_.q_dot = q_dot_start_;
  past_next_.c_dot_W.noalias() = state_.reduced.X_WR.rotation() * start_velocity_.c_dot;
  past_next_.omega = start_velocity_.omega;
  past_next_.R_WR = state_.reduced.X_WR.rotation();
}

// s, and (4 ẋ - ẋ⁻)/3 in start_velocity_.
void MechanismDynamics::TakePast(double h) {
  const int r = model().size();
  const MechanismPast& past = state_.past;
  const bool known = rule_ == StepRule::kTwoSteps && past.h == h;
  order_ = known ? 1.5 : 1;
  contact_shift_.setZero();
  q_dot_mixed_ = q_dot_start_;
  if (mechanism().base() == BaseKind::kDriven) {
    const Vector6 V_last = state_.reduced.V_R;
    state_.reduced.V_R = DrivenTwist(h);
    V_end_ = known ? Vector6(1.5 * state_.reduced.V_R - 0.5 * V_last) : state_.reduced.V_R;
  }
  if (!known) return;
  const Matrix3 R_RW = state_.reduced.X_WR.rotation().transpose();
  if (r > 0) contact_shift_.tail(r) = past.z_moved / (3 * h);
  if (base_size_ > 0) {
    // Of the base's frame by the turn and the way of the whole's centre of mass, whose momentum it is.
    const Vector3 turn = LogRotation(past.R_WR.transpose() * state_.reduced.X_WR.rotation()) / (3 * h);
    Vector3 momentum = M_00_(5, 5) / (3 * h) * (R_RW * (center_W_ - past.center_W));
    momentum -= M_00_.block<3, 3>(3, 0) * turn;
    for (int i = 0; i < r; ++i) momentum -= contact_shift_(6 + i) * M_0z_.col(i).tail<3>();
    contact_shift_.head<6>() << turn, momentum / M_00_(5, 5);
  }
  other_velocity_.c_dot.noalias() = R_RW * past.c_dot_W;
  other_velocity_.omega = past.omega;
  TurnFreely(rigid_parts_, h, other_velocity_);
  start_velocity_.c_dot = (4 * start_velocity_.c_dot - other_velocity_.c_dot) / 3;
  start_velocity_.omega = (4 * start_velocity_.omega - other_velocity_.omega) / 3;
  q_dot_mixed_ = (4 * q_dot_start_ - past.q_dot) / 3;
}

// x before contact, from u_ and the forces at hand.
void MechanismDynamics::SolveFreeTwoSteps(double h) {
  const int r = model().size();
  all_at_end_ = true;
  if (HasSwitches()) AddSwitchedForces();
  if (num_velocities() == 0) return;
  impulse_.setZero(num_velocities());
  A_ = order_ * order_ * M_full_;
  x_ = order_ * momentum_;
  if (base_size_ > 0) x_.head<6>() += h * base_force_;
  if (r > 0) {
    // Springs work along x + s, all else in A on x alone.
    auto A_z = A_.bottomRightCorner(r, r);
    const auto s = contact_shift_.tail(r);
    x_.tail(r) += h * f_z_;
    A_z += order_ * h * model().D;
    TurnDampers(h);
    if (order_ > 1) x_.tail(r).noalias() += A_z.selfadjointView<Eigen::Lower>() * s;
    A_z.diagonal() += h * h * model().K_r;
    TurnSprings(h);
    TurnServos(h);
    if (order_ > 1) x_.tail(r).noalias() -= A_z.selfadjointView<Eigen::Lower>() * s;
    for (std::size_t k = 0; k < state_.at_bound.size(); ++k) {
      if (state_.at_bound[k] == 0) continue;
      const Mechanism::ForceLimit& limit = mechanism().force_limits()[k];
      if (ServosTurn() || limit.length.path >= 0)
        ReducedRow(limit.length, Paths(), Q_now(), limit_row_);
      else
        ReducedRow(limit.length, paths_ref_, model().Q_rows, limit_row_);
      x_.tail(r) += h * h * limit.stiffness * limit_row_.dot(s) * limit_row_;
    }
    TakeBoundedSpringsOut(h);
  }
  if (factor_.Compute(A_))
    factor_.SolveInPlace(x_);
  else  // World::Step finds it, takes the step back and reports
    x_.setConstant(std::numeric_limits<double>::quiet_NaN());
}

Vector6 MechanismDynamics::GroupTwistFromStart(int g, const Eigen::Ref<const MatrixX>& J_T) const {
  Vector6 V = GroupTwist(g, J_T);
  if (base_size_ == 0) return V;
  const Vector6& V_R = state_.reduced.V_R;
  const Matrix3 turn = X_WR_before_.rotation().transpose() * state_.reduced.X_WR.rotation();
  V.head<3>() += turn * V_R.head<3>() - V_R.head<3>();
  V.tail<3>() += turn * V_R.tail<3>() - V_R.tail<3>();
  return V;
}

void MechanismDynamics::IntegrateTwoSteps(double h) {
  const int r = model().size();
  const bool driven = mechanism().base() == BaseKind::kDriven;
  const Matrix3 R_start = state_.reduced.X_WR.rotation();
  w_mean_ = x_.tail(r) + contact_shift_.tail(r);
  state_.reduced.z += h * w_mean_;
  // What was not pushed, by implicit Euler, follows its parabola by the mean velocity.
  const bool falls = rule_ == StepRule::kEuler && !pushed_;
  Vector3 center = Vector3::Zero();
  if (driven) state_.reduced.X_WR = state_.driven_next;
  if (base_size_ > 0) {
    rhs_ = x_ + contact_shift_;
    Vector3 momentum = M_full_.middleRows<3>(3) * rhs_;
    if (falls) {
      rhs_.head<6>() = 0.5 * (rhs_.head<6>() + V_R_before_);
      momentum = 0.5 * (momentum + R_start.transpose() * linear_W_);
    }
    center = center_W_ + h / M_00_(5, 5) * (R_start * momentum);
    state_.reduced.X_WR.rotation() = R_start * ExpRotation(h * rhs_.head<3>());
    state_.reduced.X_WR.Orthonormalize();
  }
  // The momenta that the step ends with, part by part.
  Vector6 V = Vector6::Zero();
  if (driven) V = V_end_;
  if (base_size_ > 0) V = order_ * x_.head<6>();
  q_ddot_.setZero();
  if (r > 0) {
    f_turn_ = order_ * x_.tail(r);
    AddMotion(model(), Q_now(), f_turn_, q_ddot_);
  }
  ComputeMaterialVelocities(mechanism(), rigid_parts_, configuration_.kinematics, q_ddot_, V,
                            start_velocity_);
  OwnMomentum(rigid_parts_, configuration_.kinematics, start_velocity_, F_parts_);
  tau_ = mechanism().armature().cwiseProduct(q_ddot_);

  pose_energy_.valid = false;
  Configure(model(), state_.reduced, configuration_);
  UpdateInertia();
  if (base_size_ > 0)
    state_.reduced.X_WR.translation() =
        center - state_.reduced.X_WR.rotation() * CenterOfParts(rigid_parts_, configuration_.kinematics);
  CarryMomentum(rigid_parts_, configuration_.kinematics, state_.reduced.X_WR.rotation().transpose() * R_start,
                F_parts_);
  if (driven) {
    q_ddot_.setZero();
    ComputeMaterialVelocities(mechanism(), rigid_parts_, configuration_.kinematics, q_ddot_, V_end_,
                              other_velocity_);
    AddMomentum(rigid_parts_, configuration_.kinematics, other_velocity_, Matrix3::Identity(), -1, F_parts_);
  }
  GatherFromParts(mechanism(), configuration_.kinematics.S, F_parts_, tau_);
  q_dot_ = q_dot_start_;  // ClosureForces takes the rate of joint rates from it
  TakeVelocityAtEnd(0);
  if (rule_ == StepRule::kEuler) {
    state_.past.h = 0;
    return;
  }
  past_next_.z_moved = h * w_mean_;
  past_next_.V_R = V_end_;
  std::swap(state_.past, past_next_);
}

}  // namespace fork1s
