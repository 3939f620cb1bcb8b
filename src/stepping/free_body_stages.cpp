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
#include <fork1s/linalg/cholesky.hpp>
#include <fork1s/linalg/spectrum.hpp>
#include <fork1s/stepping/free_body.hpp>

namespace fork1s {

void FreeBody::BeginStep(double b, const Vector3& gravity_W) {
  gravity_W_ = gravity_W;
  omega_B_before_ = omega_B_;
  velocity_before_ = velocity_;
  X_WB_before_ = X_WB_;
  pushed_ = false;
  step_start_ = {X_WB_.rotation(), center_W(), X_WB_.rotation() * (inertia_.rotational * omega_B_),
                 velocity_};
  stage_base_ = step_start_;
  omega_B_ += b * angular_acceleration_B_;
  velocity_ += b * acceleration_;
}

void FreeBody::MoveToStagePose(double b) {
  X_WB_.rotation() = stage_base_.R_WB * ExpRotation(b * omega_B_);
  X_WB_.Orthonormalize();
  X_WB_.translation() = stage_base_.center_W + b * velocity_ - X_WB_.rotation() * inertia_.center;
}

void FreeBody::RecordStageStart(bool of_step) {
  X_stage_start_ = X_WB_;
  center_stage_start_ = center_W();
  stage_start_ = of_step ? Velocity{omega_B_before_, velocity_before_} : Velocity{omega_B_, velocity_};
}

void FreeBody::MoveToStageStart(double b) {
  X_WB_ = X_stage_start_;
  omega_B_ = LogRotation(stage_base_.R_WB.transpose() * X_WB_.rotation()) / b;
  velocity_ = (center_stage_start_ - stage_base_.center_W) / b;
}

// ω with R I ω = l̂ + b τ(R) by Newton's method: with m = Rᵀ (l̂ + b τ), ∂m/∂ω = b ([m₀]x + b L) dexp(-b ω). m₀
// is the part of m that is constant in world axes; forces at points turn their lever, in body axes, by L =
// TurnedLever(G)ᵀ, G = Σ p (Rᵀ F)ᵀ.
Vector3 FreeBody::FreeTurning(double b, Vector3 omega) const {
  constexpr int kMaxIterations = 12;
  const Vector3 constant_W = stage_base_.spin_W + b * load_.moment_W;
  for (int i = 0; i < kMaxIterations; ++i) {
    const Matrix3 R = stage_base_.R_WB * ExpRotation(b * omega);
    const Vector3 constant = R.transpose() * constant_W;
    const Matrix3 G = load_.force_moments * R;
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
  const Vector3 arm_W = X_WB_.rotation() * (point_spring_.point_B - inertia_.center);
  Eigen::Matrix<double, 3, 6> J;
  J << -Skew(arm_W), Matrix3::Identity();
  return J;
}

// [moment about the centre; force] at the pose at hand, without the damper of the spring.
Vector6 FreeBody::StageForce() const {
  Vector6 f;
  f << load_.MomentAt(X_WB_.rotation()), load_.force_W + weight_share_ * inertia_.mass * gravity_W_;
  if (point_spring_.IsActive())
    f += SpringJacobian().transpose() * point_spring_.SpringForce(X_WB_ * point_spring_.point_B);
  return f;
}

// p̂ + b f at the pose at hand.
Vector6 FreeBody::StageMomentum(double b) const {
  Vector6 p;
  p << stage_base_.spin_W, inertia_.mass * stage_base_.velocity;
  return p + b * StageForce();
}

void FreeBody::PredictStiffStage(double b) {
  const Matrix3& R = X_WB_.rotation();
  const Vector6 V = PortTwist();
  Matrix6 K = Matrix6::Zero();
  Matrix3 moments = R * load_.force_moments;
  stage_A_.setZero();
  stage_A_.topLeftCorner<3, 3>() = R * inertia_.rotational * R.transpose();
  stage_A_.bottomRightCorner<3, 3>() = inertia_.mass * Matrix3::Identity();
  if (point_spring_.IsActive()) {
    const Eigen::Matrix<double, 3, 6> J = SpringJacobian();
    const Vector3 force =
        point_spring_.SpringForce(X_WB_ * point_spring_.point_B) - point_spring_.damping * (J * V);
    moments += R * (point_spring_.point_B - inertia_.center) * force.transpose();
    K = point_spring_.stiffness * J.transpose() * J;
    stage_A_ += b * point_spring_.damping * J.transpose() * J;
  }
  const Matrix3 turned = AppliedForces::TurnedLever(moments);
  K.topLeftCorner<3, 3>() += PositivePart(-0.5 * (turned + turned.transpose()));
  stage_A_ += b * b * K;
  stage_rhs_ = StageMomentum(b) + b * b * (K * V);
  stage_root_ = InverseRoot(stage_A_);
  const Vector6 found = stage_root_.transpose() * (stage_root_ * stage_rhs_);
  omega_B_ = R.transpose() * found.head<3>();
  velocity_ = found.tail<3>();
}

void FreeBody::PredictStage(double b, bool touched) {
  pushed_ = false;
  is_stiff_ = point_spring_.IsActive() || (touched && !load_.IsZero());
  if (is_stiff_) return PredictStiffStage(b);
  load_moment_W_ = load_.MomentAt(X_WB_.rotation());
  const Vector3 spin_W = stage_base_.spin_W + b * load_moment_W_;
  velocity_ = stage_base_.velocity + b * (weight_share_ * gravity_W_ + load_.force_W / inertia_.mass);
  omega_B_ = touched ? Vector3(InverseInertia_B() * (X_WB_.rotation().transpose() * spin_W))
                     : FreeTurning(b, omega_B_);
}

double FreeBody::MoveAndComputeStiffResidual(double b, StageMotion& moved) {
  Vector6 impulse = Vector6::Zero();  // of contact
  if (pushed_) impulse = stage_A_ * PortTwist() - stage_rhs_;
  MoveToStagePose(b);
  const Vector6 V = PortTwist();
  Vector6 momentum = StageMomentum(b) + impulse;
  if (point_spring_.IsActive()) {
    const Eigen::Matrix<double, 3, 6> J = SpringJacobian();
    momentum -= b * point_spring_.damping * (J.transpose() * (J * V));
  }
  spin_end_W_ = momentum.head<3>();
  velocity_end_ = momentum.tail<3>() / inertia_.mass;
  Vector6 present;
  present << X_WB_.rotation() * (inertia_.rotational * omega_B_), inertia_.mass * velocity_;
  moved.motion = b * std::sqrt(V.dot(present) / inertia_.mass);
  const Vector3 spun = omega_B_ - omega_B_before_, sped = velocity_ - velocity_before_;
  moved.velocity_change =
      b * std::sqrt(spun.dot(inertia_.rotational * spun) / inertia_.mass + sped.squaredNorm());
  return b * (stage_root_ * (momentum - present)).norm() / std::sqrt(inertia_.mass);
}

double FreeBody::MoveAndComputeResidual(double b, StageMotion& moved) {
  if (is_stiff_) return MoveAndComputeStiffResidual(b, moved);
  velocity_end_ = velocity_;
  // The momentum of the pose linearised at, as contact left it.
  const Vector3 spin_W = X_WB_.rotation() * (inertia_.rotational * omega_B_);
  MoveToStagePose(b);
  const Vector3 load_moment_W = load_.MomentAt(X_WB_.rotation());
  spin_end_W_ = pushed_ ? Vector3(spin_W + b * (load_moment_W - load_moment_W_))
                        : Vector3(stage_base_.spin_W + b * load_moment_W);
  const double mass = inertia_.mass;
  moved.motion = b * std::sqrt(omega_B_.dot(inertia_.rotational * omega_B_) / mass);
  const Vector3 spun = omega_B_ - omega_B_before_;
  moved.velocity_change = b * std::sqrt(spun.dot(inertia_.rotational * spun) / mass);
  const Vector3 residual = X_WB_.rotation().transpose() * spin_end_W_ - inertia_.rotational * omega_B_;
  return b * std::sqrt(residual.dot(InverseInertia_B() * residual) / mass);
}

void FreeBody::ExtrapolateStage(double b, double onward) {
  const StageBase& start = step_start_;
  stage_base_.R_WB = start.R_WB * ExpRotation(onward * b * omega_B_);
  stage_base_.center_W = start.center_W + onward * (center_W() - start.center_W);
  stage_base_.spin_W = start.spin_W + onward * (spin_end_W_ - start.spin_W);
  stage_base_.velocity = start.velocity + onward * (velocity_end_ - start.velocity);
  omega_B_first_ = omega_B_;
  velocity_first_ = velocity_;
  omega_B_ = omega_B_before_ + (1 + onward) * (omega_B_ - omega_B_before_);
  velocity_ = velocity_before_ + (1 + onward) * (velocity_ - velocity_before_);
}

void FreeBody::EndStep(double between_stages) {
  angular_acceleration_B_.setZero();
  acceleration_.setZero();
  if (between_stages > 0) {
    angular_acceleration_B_ = (omega_B_ - omega_B_first_) / between_stages;
    acceleration_ = (velocity_ - velocity_first_) / between_stages;
  }
  omega_B_ = InverseInertia_B() * (X_WB_.rotation().transpose() * spin_end_W_);
  velocity_ = velocity_end_;
  is_stiff_ = false;
  load_ = {};
}

}  // namespace fork1s
