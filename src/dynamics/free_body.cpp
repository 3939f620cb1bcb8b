#include <fork1s/dynamics/free_body.hpp>

#include <cmath>
#include <fork1s/linalg/cholesky.hpp>

namespace fork1s {
namespace {

Matrix3 RootOf(const Matrix3& positive) {
  MatrixX L = positive;
  CholeskyInPlace(L);
  return Matrix3(L.triangularView<Eigen::Lower>());
}

}  // namespace

FreeBody::FreeBody(const FreeBodyDef& definition)
    : name_(definition.name),
      inertia_(definition.inertia),
      weight_share_(1 - definition.gravity_compensation),
      rotational_root_(RootOf(definition.inertia.rotational.inverse())),
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
  force_W_ += force_W;
  moment_W_ += moment_W + (point_W - center_W()).cross(force_W);
}

void FreeBody::Predict(double h, const Vector3& gravity_W) {
  pushed_ = false;
  if (begun_ && instant_ == Instant::kEnd) {
    PredictEnd(h, gravity_W);
    force_W_.setZero();
    moment_W_.setZero();
    return;
  }
  velocity_before_ = velocity_;
  velocity_ += h * (weight_share_ * gravity_W + force_W_ / inertia_.mass);
  omega_B_before_ = omega_B_;
  omega_B_ = TurnFreely(inertia_.rotational, omega_B_, X_WB_.rotation().transpose() * moment_W_, h);
  force_W_.setZero();
  moment_W_.setZero();
}

Vector6 FreeBody::PortTwist() const {
  Vector6 V;
  V << X_WB_.rotation() * omega_B_, velocity_;
  return V;
}

Vector6 FreeBody::OriginVelocity() const {
  Vector6 V = PortTwist();
  V.tail<3>() -= V.head<3>().cross(X_WB_.rotation() * inertia_.center);
  return V;
}

Matrix6 FreeBody::InverseInertiaRoot() const {
  Matrix6 Y = Matrix6::Zero();
  Y.topLeftCorner<3, 3>() = (X_WB_.rotation() * rotational_root_).transpose();
  Y.bottomRightCorner<3, 3>() = Matrix3::Identity() / std::sqrt(inertia_.mass);
  if (begun_ && instant_ == Instant::kEnd) Y /= order_;
  return Y;
}

void FreeBody::SetPortTwist(const Vector6& V) {
  pushed_ = true;
  omega_B_ = X_WB_.rotation().transpose() * V.head<3>();
  velocity_ = V.tail<3>();
}

void FreeBody::Begin(double h, Instant instant) {
  X_WB_before_ = X_WB_;
  omega_B_before_ = omega_B_;
  velocity_before_ = velocity_;
  begun_ = true;
  instant_ = instant;
  order_ = 1;
  if (instant == Instant::kMiddle) {
    const Vector3 center = center_W() + 0.5 * h * velocity_;
    X_WB_.rotation() = X_WB_.rotation() * ExpRotation(0.5 * h * omega_B_);
    X_WB_.translation() = center - X_WB_.rotation() * inertia_.center;
    return;
  }
  // docs/method.md, section 5: where two steps lead, or one.
  const Vector3 center = center_W();
  Vector3 way = h * velocity_, turn = h * omega_B_;
  if (past_.h == h) {
    order_ = 1.5;
    way = 2 * way - (center - past_.center_W);
    turn = 2 * turn - LogRotation(past_.R_WB.transpose() * X_WB_.rotation());
  }
  X_WB_.rotation() = X_WB_.rotation() * ExpRotation(turn);
  X_WB_.translation() = center + way - X_WB_.rotation() * inertia_.center;
  moved_ << X_WB_.rotation() * turn / h, way / h;
  onward_ << -turn / h, -way / h;
  if (order_ > 1) {
    const Vector3 before = LogRotation(X_WB_.rotation().transpose() * past_.R_WB);
    onward_.head<3>() += (-turn - before) / (3 * h);
    onward_.tail<3>() += (center - past_.center_W) / (3 * h);
  }
}

Vector6 FreeBody::Onward() const {
  Vector6 V;
  V << X_WB_.rotation() * onward_.head<3>(), onward_.tail<3>();
  return V;
}

// The velocities of the start as the end sees them.
void FreeBody::PredictEnd(double h, const Vector3& gravity_W) {
  const Matrix3& I = inertia_.rotational;
  omega_B_ = TurnFreely(I, omega_B_, Vector3::Zero(), h);
  if (order_ > 1) {
    omega_B_ = (4 * omega_B_ - TurnFreely(I, past_.omega_B, Vector3::Zero(), 2 * h)) / 3;
    velocity_ = (4 * velocity_ - past_.velocity) / 3;
  }
  const double share = h / order_;
  velocity_ += share * (weight_share_ * gravity_W + force_W_ / inertia_.mass);
  omega_B_ += share * (rotational_root_ * (rotational_root_.transpose() * (X_WB_.rotation().transpose() * moment_W_)));
  velocity_ /= order_;
  omega_B_ /= order_;
}

// The pose at the end of a step whose contacts were found where it was foreseen to end.
void FreeBody::IntegrateEnd(double h) {
  const Vector3 turn = h * (omega_B_ + onward_.head<3>());
  const Vector3 center = center_W() + h * (velocity_ + onward_.tail<3>());
  X_WB_.rotation() = X_WB_.rotation() * ExpRotation(turn);
  X_WB_.Orthonormalize();
  X_WB_.translation() = center - X_WB_.rotation() * inertia_.center;
  omega_B_ *= order_;
  velocity_ *= order_;
}

void FreeBody::Integrate(double h) {
  const bool second_order = begun_;
  if (begun_ && instant_ == Instant::kEnd) {
    IntegrateEnd(h);
  } else {
    // Free flight follows its parabola by the mean velocity. Contact asks that gaps stay closed at the end
    // velocity.
    const double start = pushed_ ? 0 : 0.5, end = 1 - start;
    if (begun_) X_WB_ = X_WB_before_;
    const Vector3 center = center_W() + h * (start * velocity_before_ + end * velocity_);
    X_WB_.rotation() = X_WB_.rotation() * ExpRotation(h * (start * omega_B_before_ + end * omega_B_));
    X_WB_.Orthonormalize();
    X_WB_.translation() = center - X_WB_.rotation() * inertia_.center;
  }
  past_ = Past();
  if (second_order)
    past_ = {h, X_WB_before_.rotation(), X_WB_before_ * inertia_.center, omega_B_before_, velocity_before_};
  begun_ = false;
}

void FreeBody::Revert() {
  if (begun_) X_WB_ = X_WB_before_;
  begun_ = false;
  omega_B_ = omega_B_before_;
  velocity_ = velocity_before_;
}

void FreeBody::Restore(const State& state) {
  X_WB_ = state.X_WB;
  omega_B_ = omega_B_before_ = state.omega_B;
  velocity_ = velocity_before_ = state.velocity;
  force_W_ = state.force_W;
  moment_W_ = state.moment_W;
  past_ = state.past;
  pushed_ = begun_ = false;
}

double FreeBody::KineticEnergy() const {
  return 0.5 * (omega_B_.dot(inertia_.rotational * omega_B_) + inertia_.mass * velocity_.squaredNorm());
}

}  // namespace fork1s
