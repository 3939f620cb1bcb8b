#include <fork1s/dynamics/free_body.hpp>

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

void FreeBody::Predict(double h, const Vector3& gravity_W) {
  pushed_ = false;
  velocity_before_ = velocity_;
  omega_B_before_ = omega_B_;
  const Vector3 acceleration = weight_share_ * gravity_W + load_.force_W / inertia_.mass;
  const Vector3 moment_B = X_WB_.rotation().transpose() * load_.MomentAt(X_WB_.rotation());
  const Matrix3& I = inertia_.rotational;
  velocity_ += h * acceleration;
  omega_B_ = TurnFreely(I, omega_B_, moment_B, h);
  if (order_ > 1) {
    // v⁺ = (4 v - v⁻ + 2 h a)/3, all as it is at the end of the step
    velocity_ = (4 * velocity_before_ - past_.velocity + 2 * h * acceleration) / (3 * order_);
    const Vector3 before = TurnFreely(I, past_.omega_B, Vector3::Zero(), 2 * h);
    const Vector3 unpushed = TurnFreely(I, omega_B_before_, Vector3::Zero(), h);
    omega_B_ = (2 * unpushed - before + 2 * omega_B_) / (3 * order_);
  }
  load_ = {};
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
  Y /= order_;
  return Y;
}

void FreeBody::SetPortTwist(const Vector6& V) {
  pushed_ = true;
  omega_B_ = X_WB_.rotation().transpose() * V.head<3>();
  velocity_ = V.tail<3>();
}

bool FreeBody::BeginsAnew(double h) const {
  if (past_.h != h) return true;
  if (!past_.anew) return false;
  const Matrix3& I = inertia_.rotational;
  const Vector3 before = TurnFreely(I, past_.omega_B, Vector3::Zero(), h);
  const auto product = [&](const Vector3& v, const Vector3& omega, const Vector3& y, const Vector3& turn) {
    return inertia_.mass * v.dot(y) + omega.dot(I * turn);
  };
  return ParabolaComesBack(product(velocity_, omega_B_, velocity_, omega_B_),
                           product(past_.velocity, before, past_.velocity, before),
                           product(velocity_, omega_B_, past_.velocity, before));
}

void FreeBody::Begin(double h, StepRule rule) {
  X_WB_before_ = X_WB_;
  omega_B_before_ = omega_B_;
  velocity_before_ = velocity_;
  rule_ = rule;
  turn_shift_.setZero();
  way_shift_.setZero();
  if (rule == StepRule::kMiddle) {
    const Vector3 center = center_W() + 0.5 * h * velocity_;
    X_WB_.rotation() = X_WB_.rotation() * ExpRotation(0.5 * h * omega_B_);
    X_WB_.translation() = center - X_WB_.rotation() * inertia_.center;
  } else if (past_.h == h) {  // docs/method.md, section 5
    order_ = 1.5;
    turn_shift_ = LogRotation(past_.R_WB.transpose() * X_WB_.rotation()) / (3 * h);
    way_shift_ = (center_W() - past_.center_W) / (3 * h);
  }
}

Vector6 FreeBody::Shift() const {
  Vector6 V;
  V << X_WB_.rotation() * turn_shift_, way_shift_;
  return V;
}

void FreeBody::Integrate(double h) {
  // Free flight follows its parabola by the mean velocity. Contact asks that gaps stay closed at the end
  // velocity.
  const double start = pushed_ || order_ > 1 ? 0 : 0.5, end = 1 - start;
  if (rule_ != StepRule::kEuler) X_WB_ = X_WB_before_;
  const Vector3 center = center_W();
  const Vector3 way = start * velocity_before_ + end * velocity_ + way_shift_;
  X_WB_.rotation() =
      X_WB_.rotation() * ExpRotation(h * (start * omega_B_before_ + end * omega_B_ + turn_shift_));
  X_WB_.Orthonormalize();
  X_WB_.translation() = center + h * way - X_WB_.rotation() * inertia_.center;
  omega_B_ *= order_;
  velocity_ *= order_;
  past_.h = 0;
  if (rule_ != StepRule::kEuler)
    past_ = {h, false, X_WB_before_.rotation(), center, omega_B_before_, velocity_before_};
  EndStep();
}

void FreeBody::EndStep() {
  is_stiff_ = false;
  rule_ = StepRule::kEuler;
  order_ = 1;
  turn_shift_.setZero();
  way_shift_.setZero();
}

void FreeBody::Restore(const State& state) {
  X_WB_ = state.X_WB;
  omega_B_ = omega_B_before_ = state.omega_B;
  velocity_ = velocity_before_ = state.velocity;
  load_ = state.load;
  point_spring_ = state.point_spring;
  past_ = state.past;
  angular_acceleration_B_ = state.angular_acceleration_B;
  acceleration_ = state.acceleration;
  pushed_ = false;
  EndStep();
}

double FreeBody::KineticEnergy() const {
  return 0.5 * (omega_B_.dot(inertia_.rotational * omega_B_) + inertia_.mass * velocity_.squaredNorm());
}

}  // namespace fork1s
