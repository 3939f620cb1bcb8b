#include <fork1s/stepping/free_body.hpp>

#include <cmath>
#include <fork1s/linalg/cholesky.hpp>

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
      rotational_root_(CholeskyRoot(definition.inertia.rotational.inverse())),
      X_WB_(definition.X_WB) {}

void FreeBody::SetState(const RigidTransform& X_WB, const Vector3& omega_W,
                        const Vector3& velocity_of_origin_W) {
  X_WB_ = X_WB;
  omega_B_ = X_WB.rotation().transpose() * omega_W;
  omega_B_before_ = omega_B_;
  velocity_ = velocity_of_origin_W + omega_W.cross(X_WB.rotation() * inertia_.center);
  velocity_before_ = velocity_;
}

void FreeBody::AddWrench(const Vector3& force_W, const Vector3& moment_W, const Vector3& point_W) {
  load_.Add(force_W, moment_W, X_WB_.rotation().transpose() * (point_W - center_W()));
}

Vector6 FreeBody::PortTwist() const {
  Vector6 V;
  V << X_WB_.rotation() * omega_B_, velocity_;
  return V;
}

Vector6 FreeBody::StartPortTwist() const {
  Vector6 V;
  V << X_stage_start_.rotation() * stage_start_.omega_B, stage_start_.center;
  return V;
}

Vector6 FreeBody::OriginVelocity() const {
  Vector6 V = PortTwist();
  V.tail<3>() -= V.head<3>().cross(X_WB_.rotation() * inertia_.center);
  return V;
}

Matrix6 FreeBody::InverseInertiaRoot() const {
  if (is_stiff_) return stage_root_;
  Matrix6 Y = Matrix6::Zero();
  Y.topLeftCorner<3, 3>() = (X_WB_.rotation() * rotational_root_).transpose();
  Y.bottomRightCorner<3, 3>() = Matrix3::Identity() / std::sqrt(inertia_.mass);
  return Y;
}

void FreeBody::SetPortTwist(const Vector6& V) {
  pushed_ = true;
  omega_B_ = X_WB_.rotation().transpose() * V.head<3>();
  velocity_ = V.tail<3>();
}

void FreeBody::Restore(const State& state) {
  X_WB_ = state.X_WB;
  omega_B_ = omega_B_before_ = state.omega_B;
  velocity_ = velocity_before_ = state.velocity;
  load_ = state.load;
  point_spring_ = state.point_spring;
  angular_acceleration_B_ = state.angular_acceleration_B;
  acceleration_ = state.acceleration;
  pushed_ = is_stiff_ = false;
}

double FreeBody::KineticEnergy() const {
  return 0.5 * (omega_B_.dot(inertia_.rotational * omega_B_) + inertia_.mass * velocity_.squaredNorm());
}

}  // namespace fork1s
