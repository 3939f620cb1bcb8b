#include "spatial/twist_exponential.hpp"

#include <algorithm>
#include <cmath>

namespace fork1s {
namespace {

// Below this angle [rad] the coefficients are sums of their Taylor series, above it closed forms, which lose digits to
// cancellation at small angles. Ten terms leave a remainder below 1e-18 here.
constexpr double kSeriesAngle = 1.5;
constexpr int kTerms = 10;

// Factors of θ^2k in b, c, b' and c': with σ = (-1)^k
//     σ / (2k+2)!,   σ / (2k+3)!,   -σ (2k+2) / (2k+4)!,   -σ (2k+2) / (2k+5)!
struct Series {
  double factor[kTerms][4] = {};
  constexpr Series() {
    double factorial = 2, sign = 1;  // (2k+2)!
    for (int k = 0; k < kTerms; ++k) {
      const double n = 2 * k + 2;
      factor[k][0] = sign / factorial;
      factor[k][1] = sign / (factorial * (n + 1));
      factor[k][2] = -sign * n / (factorial * (n + 1) * (n + 2));
      factor[k][3] = -sign * n / (factorial * (n + 1) * (n + 2) * (n + 3));
      factorial *= (n + 1) * (n + 2);
      sign = -sign;
    }
  }
};
constexpr Series kSeries;

// exp(w) = cos θ 1 + sinc W + b w wᵀ, written out: this is the hot line of pose recovery.
Matrix3 Rotation(const Vector3& w, const ExpCoefficients& k) {
  const double x = w.x(), y = w.y(), z = w.z();
  const double cosine = 1 - k.b * w.squaredNorm();
  const double xy = k.b * x * y, xz = k.b * x * z, yz = k.b * y * z;
  const double sx = k.sinc * x, sy = k.sinc * y, sz = k.sinc * z;
  Matrix3 R;
  R << cosine + k.b * x * x, xy - sz, xz + sy, xy + sz, cosine + k.b * y * y, yz - sx, xz - sy, yz + sx,
      cosine + k.b * z * z;
  return R;
}

}  // namespace

ExpCoefficients EvaluateExpCoefficients(double theta_squared) {
  const double t2 = theta_squared;
  if (t2 < kSeriesAngle * kSeriesAngle) {
    Quad sum = QuadAt(kSeries.factor[kTerms - 1]);
    for (int k = kTerms - 2; k >= 0; --k) sum = QuadAt(kSeries.factor[k]) + t2 * sum;
    return {1 - t2 * sum[1], sum[0], sum[1], sum[2], sum[3]};
  }
  // One sine and cosine, of the half angle, are enough.
  const double theta = std::sqrt(t2), half = std::sin(0.5 * theta);
  const double s = 2 * half * std::cos(0.5 * theta);
  const double sinc = s / theta, b = 2 * half * half / t2, c = (theta - s) / (t2 * theta);
  return {sinc, b, c, (sinc - 2 * b) / t2, (b - 3 * c) / t2};
}

RigidTransform::RigidTransform(const Quaternion& q, const Vector3& p)
    : R_(q.normalized().toRotationMatrix()), p_(p) {}

Quaternion RigidTransform::quaternion() const { return Quaternion(R_); }

void RigidTransform::Orthonormalize() { R_ = Quaternion(R_).normalized().toRotationMatrix(); }

// 0 times what is not finite is no number.
bool RigidTransform::IsFinite() const {
  const double* x = data();
  return (0 * QuadAt(x) + 0 * QuadAt(x + 4) + 0 * QuadAt(x + 8)).sum() == 0;
}

Matrix3 ExpRotation(const Vector3& w) { return Rotation(w, EvaluateExpCoefficients(w.squaredNorm())); }

Vector3 LogRotation(const Matrix3& R) {
  // The quaternion's vector part keeps full precision near π, its atan2 near 0 and in between.
  Quaternion q(R);
  q.normalize();
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double s = q.vec().norm();
  if (s == 0) return Vector3::Zero();
  const double angle = 2 * std::atan2(s, q.w());
  return q.vec() * (angle / s);
}

Matrix3 DexpRotation(const Vector3& w) {
  const ExpCoefficients k = EvaluateExpCoefficients(w.squaredNorm());
  const Matrix3 W = Skew(w);
  return Matrix3::Identity() + k.b * W + k.c * (W * W);
}

Matrix3 DexpInverseRotation(const Vector3& w) {
  const double theta = w.norm();
  const double t2 = theta * theta;
  double d;           // (1 - θ/2 cot(θ/2)) / θ²
  if (theta < 0.2) {  // five terms leave a remainder below 1e-17
    d = (1 + t2 / 60 * (1 + t2 / 42 * (1 + t2 / 40 * (1 + t2 * 10 / 396)))) / 12;
  } else {
    const double half = 0.5 * theta;
    d = (1 - half * std::cos(half) / std::sin(half)) / t2;
  }
  const Matrix3 W = Skew(w);
  return Matrix3::Identity() - 0.5 * W + d * (W * W);
}

RigidTransform Exp(const Vector6& x) {
  RigidTransform X{RigidTransform::Unset()};
  TwistExponential(x).SetTransform(X);
  return X;
}

Vector6 Log(const RigidTransform& X) {
  Vector6 x;
  x.head<3>() = LogRotation(X.rotation());
  x.tail<3>() = DexpInverseRotation(x.head<3>()) * X.translation();
  return x;
}

Matrix6 Adjoint(const RigidTransform& X) {
  Matrix6 A = Matrix6::Zero();
  A.topLeftCorner<3, 3>() = X.rotation();
  A.bottomRightCorner<3, 3>() = X.rotation();
  A.bottomLeftCorner<3, 3>() = Skew(X.translation()) * X.rotation();
  return A;
}

Matrix6 SmallAdjoint(const Vector6& x) {
  Matrix6 A = Matrix6::Zero();
  A.topLeftCorner<3, 3>() = Skew(x.head<3>());
  A.bottomRightCorner<3, 3>() = A.topLeftCorner<3, 3>();
  A.bottomLeftCorner<3, 3>() = Skew(x.tail<3>());
  return A;
}

Matrix6 Dexp(const Vector6& x) {
  const TwistExponential exponential(x);
  Matrix6 A;
  for (int i = 0; i < 6; ++i) {
    Quad angular, linear;
    exponential.Apply(Vector6::Unit(i).eval().data(), angular, linear);
    A.col(i) << angular.head<3>(), linear.head<3>();
  }
  return A;
}

Matrix6 DexpInverse(const Vector6& x) {
  const Matrix6 D = Dexp(x);
  const Matrix3 J_inverse = DexpInverseRotation(x.head<3>());
  Matrix6 A = Matrix6::Zero();
  A.topLeftCorner<3, 3>() = J_inverse;
  A.bottomRightCorner<3, 3>() = J_inverse;
  A.bottomLeftCorner<3, 3>() = -J_inverse * D.bottomLeftCorner<3, 3>() * J_inverse;
  return A;
}

}  // namespace fork1s
