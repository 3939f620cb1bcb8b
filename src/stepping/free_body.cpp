#include <fork1s/stepping/free_body.hpp>

#include <cmath>

#include "linalg/cholesky.hpp"

namespace fork1s {
namespace {

Matrix3 CholeskyRoot(const Matrix3& positive) {
  MatrixX L = positive;
  CholeskyInPlace(L);
  return Matrix3(L.triangularView<Eigen::Lower>());
}

}  // namespace

FreeBody::FreeBody(const FreeBodyDef& definition)
    : name_(definition.name),
      inertia_(definition.inertia),
      weight_share_(1 - definition.gravity_compensation),
      rotational_root_(CholeskyRoot(definition.inertia.rotational.inverse())) {
  state_.X_WB = definition.X_WB;
}

void FreeBody::SetState(const RigidTransform& X_WB, const Vector3& omega_W,
                        const Vector3& velocity_of_origin_W) {
  state_.X_WB = X_WB;
  state_.omega_B = X_WB.rotation().transpose() * omega_W;
  step_.omega_B = state_.omega_B;
  state_.velocity = velocity_of_origin_W + omega_W.cross(X_WB.rotation() * inertia_.center);
  step_.velocity = state_.velocity;
}

void FreeBody::AddWrench(const Vector3& force_W, const Vector3& moment_W, const Vector3& point_W) {
  state_.load.Add(force_W, moment_W, state_.X_WB.rotation().transpose() * (point_W - center_W()));
}

Vector6 FreeBody::PortTwist() const {
  Vector6 V;
  V << state_.X_WB.rotation() * state_.omega_B, state_.velocity;
  return V;
}

Vector6 FreeBody::StartPortTwist() const {
  Vector6 V;
  V << stage_start_.X_WB.rotation() * stage_start_.velocity.omega_B, stage_start_.velocity.center;
  return V;
}

Vector6 FreeBody::OriginVelocity() const {
  Vector6 V = PortTwist();
  V.tail<3>() -= V.head<3>().cross(state_.X_WB.rotation() * inertia_.center);
  return V;
}

Matrix6 FreeBody::InverseInertiaRoot() const {
  if (stage_.is_stiff) return stage_.root;
  Matrix6 Y = Matrix6::Zero();
  Y.topLeftCorner<3, 3>() = (state_.X_WB.rotation() * rotational_root_).transpose();
  Y.bottomRightCorner<3, 3>() = Matrix3::Identity() / std::sqrt(inertia_.mass);
  return Y;
}

void FreeBody::SetPortTwist(const Vector6& V) {
  step_.pushed = true;
  state_.omega_B = state_.X_WB.rotation().transpose() * V.head<3>();
  state_.velocity = V.tail<3>();
}

void FreeBody::Restore(const State& state) {
  state_ = state;
  step_.omega_B = state.omega_B;
  step_.velocity = state.velocity;
  step_.pushed = stage_.is_stiff = false;
}

double FreeBody::KineticEnergy() const {
  return 0.5 * (state_.omega_B.dot(inertia_.rotational * state_.omega_B) +
                inertia_.mass * state_.velocity.squaredNorm());
}

}  // namespace fork1s
