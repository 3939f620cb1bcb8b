#include "free_body.hpp"

#include <algorithm>

namespace fork1s::internal {

FullFreeBody::FullFreeBody(const FreeBodyDef& definition)
    : inertia_(definition.inertia),
      weight_share_(1 - definition.gravity_compensation),
      inverse_rotational_(definition.inertia.rotational.inverse()),
      X_WB_(definition.X_WB) {}

void FullFreeBody::SetState(const RigidTransform& X_WB, const Vector3& omega_W,
                            const Vector3& velocity_of_origin_W) {
  X_WB_ = X_WB;
  omega_B_ = X_WB.rotation().transpose() * omega_W;
  velocity_ = velocity_of_origin_W + omega_W.cross(X_WB.rotation() * inertia_.center);
}

void FullFreeBody::AddWrench(const Vector3& force_W, const Vector3& moment_W, const Vector3& point_W) {
  force_W_ += force_W;
  moment_W_ += moment_W + (point_W - center_W()).cross(force_W);
  loads_.push_back({force_W, moment_W, X_WB_.inverse() * point_W});
}

Vector6 FullFreeBody::PortTwist() const {
  Vector6 V;
  V << X_WB_.rotation() * omega_B_, velocity_;
  return V;
}

Vector6 FullFreeBody::Velocity() const {
  const Vector3 omega_W = X_WB_.rotation() * omega_B_;
  Vector6 V;
  V << omega_W, velocity_ - omega_W.cross(X_WB_.rotation() * inertia_.center);
  return V;
}

void FullFreeBody::Begin(double h, const Vector3& gravity_W) {
  h_ = h;
  gravity_W_ = gravity_W;
  stage_ = false;
  omega_B_next_ = omega_B_;
  velocity_next_ = velocity_;
}

void FullFreeBody::GoOn(double onward) {
  const Vector3 end_W = X_next_.rotation() * (inertia_.rotational * omega_B_next_);
  turning_W_ += onward * (end_W - turning_W_);
  start_velocity_ += onward * (velocity_next_ - start_velocity_);
  X_WB_ = Moved(omega_B_next_, velocity_next_, onward * h_);
  omega_B_ = omega_B_next_;
  velocity_ = velocity_next_;
}

void FullFreeBody::BeginStage(double h, const Vector3& gravity_W, bool second) {
  h_ = h;
  gravity_W_ = gravity_W;
  stage_ = true;
  if (!second) {
    turning_W_ = X_WB_.rotation() * (inertia_.rotational * omega_B_);
    start_velocity_ = velocity_;
  }
  omega_B_next_ = omega_B_;
  velocity_next_ = velocity_;
  contact_moment_W_.setZero();
  X_next_ = Moved(omega_B_next_, velocity_next_, h_);
}

Vector3 FullFreeBody::LoadMoment(const Matrix3& R) const {
  Vector3 moment = Vector3::Zero();
  for (const Load& load : loads_)
    moment += load.moment_W + (R * (load.point_B - inertia_.center)).cross(load.force_W);
  return moment;
}

RigidTransform FullFreeBody::Moved(const Vector3& omega_B, const Vector3& velocity, double h) const {
  RigidTransform X(Matrix3(X_WB_.rotation() * ExpRotation(h * omega_B)), Vector3::Zero());
  X.Orthonormalize();
  X.translation() = center_W() + h * velocity - X.rotation() * inertia_.center;
  return X;
}

// I ω = exp(h ω)ᵀ R_startᵀ l by Newton, l with the moments of this iteration: with m the right side,
// ∂m/∂ω = h [m]x dexp(-h ω).
Vector3 FullFreeBody::FreeTurning() const {
  const Vector3 l_B =
      X_WB_.rotation().transpose() * (turning_W_ + h_ * LoadMoment(X_next_.rotation()) + contact_moment_W_);
  Vector3 omega = omega_B_next_;
  for (int i = 0; i < 8; ++i) {
    const Vector3 m = ExpRotation(h_ * omega).transpose() * l_B;
    const Matrix3 tangent = inertia_.rotational - h_ * Skew(m) * DexpRotation(-h_ * omega);
    const Vector3 change = tangent.inverse() * (m - inertia_.rotational * omega);
    omega += change;
    if (!(change.norm() > 1e-15 * omega.norm())) break;
  }
  return omega;
}

Vector6 FullFreeBody::NextPortTwist() const {
  Vector6 V;
  V << X_next_.rotation() * omega_B_next_, velocity_next_;
  return V;
}

Matrix6 FullFreeBody::InverseInertia() const {
  Matrix6 W = Matrix6::Zero();
  const Matrix3& R = stage_ ? X_next_.rotation() : X_WB_.rotation();
  W.topLeftCorner<3, 3>() = R * inverse_rotational_ * R.transpose();
  W.bottomRightCorner<3, 3>() = Matrix3::Identity() / inertia_.mass;
  return W;
}

Vector6 FullFreeBody::FreePortTwist() const {
  if (stage_) {
    // At the guess, less what contact gave it in the last iteration, so that contact is free to give another.
    const Matrix3 R = X_next_.rotation();
    Vector6 V;
    V << R * (FreeTurning() - inverse_rotational_ * (R.transpose() * contact_moment_W_)),
        start_velocity_ + h_ * (weight_share_ * gravity_W_ + force_W_ / inertia_.mass);
    return V;
  }
  const Vector3 mean = 0.5 * (omega_B_ + omega_B_next_);
  const Vector3 torque = X_WB_.rotation().transpose() * moment_W_;
  const Vector3 omega =
      omega_B_ + h_ * (inverse_rotational_ * (torque - mean.cross(inertia_.rotational * mean)));
  Vector6 V;
  V << X_WB_.rotation() * omega, velocity_ + h_ * (weight_share_ * gravity_W_ + force_W_ / inertia_.mass);
  return V;
}

double FullFreeBody::Accept(const Vector6& port_twist) {
  if (stage_) {
    const Matrix3 R = X_next_.rotation();
    const Vector3 turn = R.transpose() * port_twist.head<3>(),
                  free = R.transpose() * FreePortTwist().head<3>();
    const double change =
        h_ * std::max((turn - omega_B_next_).norm(), (port_twist.tail<3>() - velocity_next_).norm());
    contact_moment_W_ = R * (inertia_.rotational * (turn - free));
    omega_B_next_ = turn;
    velocity_next_ = port_twist.tail<3>();
    X_next_ = Moved(omega_B_next_, velocity_next_, h_);
    return change;
  }
  const Vector3 omega = X_WB_.rotation().transpose() * port_twist.head<3>();
  const double change =
      h_ * std::max((omega - omega_B_next_).norm(), (port_twist.tail<3>() - velocity_next_).norm());
  omega_B_next_ = omega;
  velocity_next_ = port_twist.tail<3>();
  return change;
}

void FullFreeBody::Commit() {
  if (stage_) {
    X_WB_ = X_next_;
    omega_B_ = omega_B_next_;
    velocity_ = velocity_next_;
    return;
  }
  const double start = pushed ? 0 : 0.5, end = 1 - start;
  const Vector3 center = center_W() + h_ * (start * velocity_ + end * velocity_next_);
  X_WB_.rotation() = X_WB_.rotation() * ExpRotation(h_ * (start * omega_B_ + end * omega_B_next_));
  X_WB_.Orthonormalize();
  X_WB_.translation() = center - X_WB_.rotation() * inertia_.center;
  omega_B_ = omega_B_next_;
  velocity_ = velocity_next_;
}

void FullFreeBody::ClearLoads() {
  loads_.clear();
  force_W_.setZero();
  moment_W_.setZero();
}

double FullFreeBody::KineticEnergy() const {
  return 0.5 * (omega_B_.dot(inertia_.rotational * omega_B_) + inertia_.mass * velocity_.squaredNorm());
}

Vector6 FullFreeBody::Momentum() const {
  Vector6 p;
  p << X_WB_.rotation() * (inertia_.rotational * omega_B_) + inertia_.mass * center_W().cross(velocity_),
      inertia_.mass * velocity_;
  return p;
}

}  // namespace fork1s::internal
