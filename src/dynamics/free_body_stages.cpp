// One implicit stage of a free rigid body.
//
//     R I ω = l̂ + b τ(R) + contact,   R = R̂ exp(b ω),   v = v̂ + b a + contact,   c = ĉ + b v
// l̂ is the spin in world axes, a flat space: what turns freely keeps it. τ(R) is the moment of forces at
// points of the body, constant in world axes. Its stiffness, not symmetric, is in the equation of a body that
// nothing touches. Where contact acts, τ is that of the last pose, and the iteration contracts by b² |τ'|/I.
#include <cmath>
#include <fork1s/dynamics/free_body.hpp>

namespace fork1s {

void FreeBody::BeginTwoStageStep(double b, const Vector3& gravity_W) {
  gravity_W_ = gravity_W;
  omega_B_before_ = omega_B_;
  velocity_before_ = velocity_;
  X_WB_before_ = X_WB_;
  pushed_ = false;
  step_start_ = {X_WB_.rotation(), center_W(), X_WB_.rotation() * (inertia_.rotational * omega_B_), velocity_};
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

void FreeBody::PredictStage(double b, bool touched) {
  pushed_ = false;
  load_moment_W_ = load_.MomentAt(X_WB_.rotation());
  const Vector3 spin_W = stage_base_.spin_W + b * load_moment_W_;
  velocity_ = stage_base_.velocity + b * (weight_share_ * gravity_W_ + load_.force_W / inertia_.mass);
  omega_B_ = touched ? Vector3(InverseInertia_B() * (X_WB_.rotation().transpose() * spin_W))
                     : FreeTurning(b, omega_B_);
}

double FreeBody::MoveAndComputeResidual(double b, double& motion) {
  // The momentum of the pose linearised at, as contact left it.
  const Vector3 spin_W = X_WB_.rotation() * (inertia_.rotational * omega_B_);
  MoveToStagePose(b);
  const Vector3 load_moment_W = load_.MomentAt(X_WB_.rotation());
  spin_end_W_ = pushed_ ? Vector3(spin_W + b * (load_moment_W - load_moment_W_))
                        : Vector3(stage_base_.spin_W + b * load_moment_W);
  const double mass = inertia_.mass;
  motion = b * std::sqrt(omega_B_.dot(inertia_.rotational * omega_B_) / mass);
  const Vector3 residual = X_WB_.rotation().transpose() * spin_end_W_ - inertia_.rotational * omega_B_;
  return b * std::sqrt(residual.dot(InverseInertia_B() * residual) / mass);
}

void FreeBody::ExtrapolateStage(double b, double onward) {
  const StageBase& start = step_start_;
  stage_base_.R_WB = start.R_WB * ExpRotation(onward * b * omega_B_);
  stage_base_.center_W = start.center_W + onward * (center_W() - start.center_W);
  stage_base_.spin_W = start.spin_W + onward * (spin_end_W_ - start.spin_W);
  stage_base_.velocity = start.velocity + onward * (velocity_ - start.velocity);
  omega_B_first_ = omega_B_;
  velocity_first_ = velocity_;
  omega_B_ = omega_B_before_ + (1 + onward) * (omega_B_ - omega_B_before_);
  velocity_ = velocity_before_ + (1 + onward) * (velocity_ - velocity_before_);
}

void FreeBody::EndTwoStageStep(double between_stages) {
  angular_acceleration_B_.setZero();
  acceleration_.setZero();
  if (between_stages > 0) {
    angular_acceleration_B_ = (omega_B_ - omega_B_first_) / between_stages;
    acceleration_ = (velocity_ - velocity_first_) / between_stages;
  }
  omega_B_ = InverseInertia_B() * (X_WB_.rotation().transpose() * spin_end_W_);
  load_ = {};
  past_.h = 0;
}

}  // namespace fork1s
