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
  omega_B_next_ = omega_B_;
  velocity_next_ = velocity_;
}

Matrix6 FullFreeBody::InverseInertia() const {
  Matrix6 W = Matrix6::Zero();
  const Matrix3& R = X_WB_.rotation();
  W.topLeftCorner<3, 3>() = R * inverse_rotational_ * R.transpose();
  W.bottomRightCorner<3, 3>() = Matrix3::Identity() / inertia_.mass;
  return W;
}

Vector6 FullFreeBody::FreePortTwist() const {
  const Vector3 mean = 0.5 * (omega_B_ + omega_B_next_);
  const Vector3 torque = X_WB_.rotation().transpose() * moment_W_;
  const Vector3 omega =
      omega_B_ + h_ * (inverse_rotational_ * (torque - mean.cross(inertia_.rotational * mean)));
  Vector6 V;
  V << X_WB_.rotation() * omega, velocity_ + h_ * (weight_share_ * gravity_W_ + force_W_ / inertia_.mass);
  return V;
}

double FullFreeBody::Accept(const Vector6& port_twist) {
  const Vector3 omega = X_WB_.rotation().transpose() * port_twist.head<3>();
  const double change =
      h_ * std::max((omega - omega_B_next_).norm(), (port_twist.tail<3>() - velocity_next_).norm());
  omega_B_next_ = omega;
  velocity_next_ = port_twist.tail<3>();
  return change;
}

void FullFreeBody::Commit() {
  const double start = pushed ? 0 : 0.5, end = 1 - start;
  const Vector3 center = center_W() + h_ * (start * velocity_ + end * velocity_next_);
  X_WB_.rotation() = X_WB_.rotation() * ExpRotation(h_ * (start * omega_B_ + end * omega_B_next_));
  X_WB_.Orthonormalize();
  X_WB_.translation() = center - X_WB_.rotation() * inertia_.center;
  omega_B_ = omega_B_next_;
  velocity_ = velocity_next_;
  Abandon();
}

void FullFreeBody::Abandon() {
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
