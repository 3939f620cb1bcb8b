// One implicit stage of a free rigid body.
//
//     R I ω = l̂ + b τ(R) + contact,   R = R̂ exp(b ω),   v = v̂ + b a + contact,   c = ĉ + b v
// l̂ is the spin in world axes, a flat space: what turns freely keeps it. τ(R) is the moment of forces at
// points of the body, constant in world axes. Its stiffness, not symmetric, is in the equation of a body that
// nothing touches.
//
// Where contact acts on a body with loads, or a point spring, the stage is linearized at the pose at hand. In
// the coordinates of contacts, V = [ω; v] in world axes about the centre,
//     A V = p̂ + b f + b² K V_k + contact,   A = M + b c JᵀJ + b² K,   K = k JᵀJ + K_g
// V_k is the velocity that led to the pose, J V the velocity of the spring's point. K_g is the symmetric part
// of -∂τ/∂θ, the geometric stiffness of loads and spring, projected onto the positive semidefinite (Teran et
// al. 2005, Robust quasistatic finite elements): A is positive definite at any stiffness. What is left out of
// it, and the turn of M, change the convergence of the iteration only, not the equation.
#include <cmath>
#include <fork1s/stepping/free_body.hpp>

#include "linalg/cholesky.hpp"
#include "linalg/spectrum.hpp"
#include "stepping/stage_motion.hpp"

namespace fork1s {

void FreeBody::BeginStep(double b, const Vector3& gravity_W) {
  step_.gravity_W = gravity_W;
  step_.omega_B = state_.omega_B;
  step_.velocity = state_.velocity;
  step_.X_WB = state_.X_WB;
  step_.pushed = false;
  step_.base = {state_.X_WB.rotation(), center_W(),
                state_.X_WB.rotation() * (inertia_.rotational * state_.omega_B), state_.velocity};
  stage_.base = step_.base;
  state_.omega_B += b * state_.angular_acceleration_B;
  state_.velocity += b * state_.acceleration;
}

void FreeBody::MoveToStagePose(double b) {
  stage_.pose_velocity = velocity();
  state_.X_WB.rotation() = stage_.base.R_WB * ExpRotation(b * state_.omega_B);
  state_.X_WB.Orthonormalize();
  state_.X_WB.translation() =
      stage_.base.center_W + b * state_.velocity - state_.X_WB.rotation() * inertia_.center;
}

void FreeBody::RecordStageStart(bool of_step) {
  stage_start_.X_WB = state_.X_WB;
  stage_start_.center_W = center_W();
  stage_start_.velocity =
      of_step ? Velocity{step_.omega_B, step_.velocity} : Velocity{state_.omega_B, state_.velocity};
}

void FreeBody::MoveToStageStart(double b) {
  state_.X_WB = stage_start_.X_WB;
  state_.omega_B = LogRotation(stage_.base.R_WB.transpose() * state_.X_WB.rotation()) / b;
  state_.velocity = (stage_start_.center_W - stage_.base.center_W) / b;
}

// ω with R I ω = l̂ + b τ(R) by Newton's method: with m = Rᵀ (l̂ + b τ), ∂m/∂ω = b ([m₀]x + b L) dexp(-b ω). m₀
// is the part of m that is constant in world axes; forces at points turn their lever, in body axes, by L =
// TurnedLever(G)ᵀ, G = Σ p (Rᵀ F)ᵀ.
Vector3 FreeBody::FreeTurning(double b, Vector3 omega) const {
  constexpr int kMaxIterations = 12;
  const Vector3 constant_W = stage_.base.spin_W + b * state_.load.moment_W;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Matrix3 R = stage_.base.R_WB * ExpRotation(b * omega);
    const Vector3 constant = R.transpose() * constant_W;
    const Matrix3 G = state_.load.force_moments * R;
    const Vector3 m = constant + b * AppliedForces::Axial(G);
    const Matrix3 turned = Skew(constant) + b * AppliedForces::TurnedLever(G).transpose();
    const Matrix3 tangent = inertia_.rotational - b * turned * DexpRotation(-b * omega);
    const Vector3 change = tangent.inverse() * (m - inertia_.rotational * omega);
    omega += change;
    if (!(change.norm() > 1e-14 * omega.norm())) break;
  }
  return omega;
}

Eigen::Matrix<double, 3, 6> FreeBody::SpringJacobian() const {
  const Vector3 arm_W = state_.X_WB.rotation() * (state_.point_spring.point_B - inertia_.center);
  Eigen::Matrix<double, 3, 6> J;
  J << -Skew(arm_W), Matrix3::Identity();
  return J;
}

// [moment about the centre; force] at the pose at hand, without the damper of the spring.
Vector6 FreeBody::StageForce() const {
  Vector6 f;
  f << state_.load.MomentAt(state_.X_WB.rotation()),
      state_.load.force_W + weight_share_ * inertia_.mass * step_.gravity_W;
  if (state_.point_spring.IsActive())
    f += SpringJacobian().transpose() *
         state_.point_spring.SpringForce(state_.X_WB * state_.point_spring.point_B);
  return f;
}

// p̂ + b f at the pose at hand.
Vector6 FreeBody::StageMomentum(double b) const {
  Vector6 p;
  p << stage_.base.spin_W, inertia_.mass * stage_.base.velocity;
  return p + b * StageForce();
}

void FreeBody::PredictStiffStage(double b) {
  const Matrix3& R = state_.X_WB.rotation();
  const Vector6 V = PortTwist();
  Matrix6 K = Matrix6::Zero();
  Matrix3 moments = R * state_.load.force_moments;
  stage_.A.setZero();
  stage_.A.topLeftCorner<3, 3>() = R * inertia_.rotational * R.transpose();
  stage_.A.bottomRightCorner<3, 3>() = inertia_.mass * Matrix3::Identity();
  if (state_.point_spring.IsActive()) {
    const Eigen::Matrix<double, 3, 6> J = SpringJacobian();
    const Vector3 force = state_.point_spring.SpringForce(state_.X_WB * state_.point_spring.point_B) -
                          state_.point_spring.damping * (J * V);
    moments += R * (state_.point_spring.point_B - inertia_.center) * force.transpose();
    K = state_.point_spring.stiffness * J.transpose() * J;
    stage_.A += b * state_.point_spring.damping * J.transpose() * J;
  }
  const Matrix3 turned = AppliedForces::TurnedLever(moments);
  K.topLeftCorner<3, 3>() += PositivePart(-0.5 * (turned + turned.transpose()));
  stage_.A += b * b * K;
  stage_.rhs = StageMomentum(b) + b * b * (K * V);
  stage_.root = InverseRoot(stage_.A);
  const Vector6 found = stage_.root.transpose() * (stage_.root * stage_.rhs);
  state_.omega_B = R.transpose() * found.head<3>();
  state_.velocity = found.tail<3>();
}

void FreeBody::PredictStage(double b, bool touched) {
  step_.pushed = false;
  stage_.is_stiff = state_.point_spring.IsActive() || (touched && !state_.load.IsZero());
  if (stage_.is_stiff) return PredictStiffStage(b);
  stage_.load_moment_W = state_.load.MomentAt(state_.X_WB.rotation());
  const Vector3 spin_W = stage_.base.spin_W + b * stage_.load_moment_W;
  state_.velocity =
      stage_.base.velocity + b * (weight_share_ * step_.gravity_W + state_.load.force_W / inertia_.mass);
  state_.omega_B = touched ? Vector3(InverseInertia_B() * (state_.X_WB.rotation().transpose() * spin_W))
                           : FreeTurning(b, state_.omega_B);
}

double FreeBody::MoveAndComputeStiffResidual(double b, StageMotion& moved) {
  Vector6 impulse = Vector6::Zero();  // of contact
  if (step_.pushed) impulse = stage_.A * PortTwist() - stage_.rhs;
  MoveToStagePose(b);
  const Vector6 V = PortTwist();
  Vector6 momentum = StageMomentum(b) + impulse;
  if (state_.point_spring.IsActive()) {
    const Eigen::Matrix<double, 3, 6> J = SpringJacobian();
    momentum -= b * state_.point_spring.damping * (J.transpose() * (J * V));
  }
  stage_.spin_end_W = momentum.head<3>();
  stage_.velocity_end = momentum.tail<3>() / inertia_.mass;
  Vector6 present;
  present << state_.X_WB.rotation() * (inertia_.rotational * state_.omega_B), inertia_.mass * state_.velocity;
  moved.motion = b * std::sqrt(V.dot(present) / inertia_.mass);
  const Vector3 spun = state_.omega_B - step_.omega_B, sped = state_.velocity - step_.velocity;
  moved.velocity_change =
      b * std::sqrt(spun.dot(inertia_.rotational * spun) / inertia_.mass + sped.squaredNorm());
  return b * (stage_.root * (momentum - present)).norm() / std::sqrt(inertia_.mass);
}

double FreeBody::MoveAndComputeResidual(double b, StageMotion& moved) {
  if (stage_.is_stiff) return MoveAndComputeStiffResidual(b, moved);
  stage_.velocity_end = state_.velocity;
  // The momentum of the pose linearized at, as contact left it.
  const Vector3 spin_W = state_.X_WB.rotation() * (inertia_.rotational * state_.omega_B);
  MoveToStagePose(b);
  const Vector3 load_moment_W = state_.load.MomentAt(state_.X_WB.rotation());
  stage_.spin_end_W = step_.pushed ? Vector3(spin_W + b * (load_moment_W - stage_.load_moment_W))
                                   : Vector3(stage_.base.spin_W + b * load_moment_W);
  const double mass = inertia_.mass;
  moved.motion = b * std::sqrt(state_.omega_B.dot(inertia_.rotational * state_.omega_B) / mass);
  const Vector3 spun = state_.omega_B - step_.omega_B;
  moved.velocity_change = b * std::sqrt(spun.dot(inertia_.rotational * spun) / mass);
  const Vector3 residual =
      state_.X_WB.rotation().transpose() * stage_.spin_end_W - inertia_.rotational * state_.omega_B;
  return b * std::sqrt(residual.dot(InverseInertia_B() * residual) / mass);
}

StageChange FreeBody::ComputeStageChange(double b) {
  const Velocity before = stage_.change;
  stage_.change = {state_.omega_B - stage_.pose_velocity.omega_B,
                   state_.velocity - stage_.pose_velocity.center};
  const auto product = [&](const Velocity& v) {
    return v.omega_B.dot(inertia_.rotational * stage_.change.omega_B) +
           inertia_.mass * v.center.dot(stage_.change.center);
  };
  StageChange out;
  out.square = product(stage_.change);
  out.with_before = product(before);
  out.change = b * std::sqrt(out.square / inertia_.mass);
  return out;
}

void FreeBody::RelaxStage(double b, double share) {
  state_.omega_B -= share * stage_.change.omega_B;
  state_.velocity -= share * stage_.change.center;
  MoveToStagePose(b);
}

void FreeBody::ExtrapolateStage(double b, double onward) {
  const StageBase& start = step_.base;
  stage_.base.R_WB = start.R_WB * ExpRotation(onward * b * state_.omega_B);
  stage_.base.center_W = start.center_W + onward * (center_W() - start.center_W);
  stage_.base.spin_W = start.spin_W + onward * (stage_.spin_end_W - start.spin_W);
  stage_.base.velocity = start.velocity + onward * (stage_.velocity_end - start.velocity);
  stage_.omega_B_first = state_.omega_B;
  stage_.velocity_first = state_.velocity;
  state_.omega_B = step_.omega_B + (1 + onward) * (state_.omega_B - step_.omega_B);
  state_.velocity = step_.velocity + (1 + onward) * (state_.velocity - step_.velocity);
}

void FreeBody::EndStep(double between_stages) {
  state_.angular_acceleration_B.setZero();
  state_.acceleration.setZero();
  if (between_stages > 0) {
    state_.angular_acceleration_B = (state_.omega_B - stage_.omega_B_first) / between_stages;
    state_.acceleration = (state_.velocity - stage_.velocity_first) / between_stages;
  }
  state_.omega_B = InverseInertia_B() * (state_.X_WB.rotation().transpose() * stage_.spin_end_W);
  state_.velocity = stage_.velocity_end;
  stage_.is_stiff = false;
  state_.load = {};
}

}  // namespace fork1s
