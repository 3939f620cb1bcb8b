#include <fork1s/spatial/rigid_transform.hpp>

#include <algorithm>
#include <cmath>

namespace fork1s {
namespace {

// Below this angle [rad] the closed forms lose digits to cancellation and their Taylor series
// are used: six terms leave a remainder below 1e-17 at 0.2.
constexpr double kSeriesAngle = 0.2;

// Coefficients of the series and closed forms in θ.
struct Coefficients {
  double sinc;  // sin θ / θ
  double b;     // (1 - cos θ) / θ²
  double c;     // (θ - sin θ) / θ³
};

Coefficients Evaluate(double theta) {
  const double t2 = theta * theta;
  if (theta < kSeriesAngle) {
    return {1 - t2 / 6 * (1 - t2 / 20 * (1 - t2 / 42 * (1 - t2 / 72 * (1 - t2 / 110)))),
            0.5 * (1 - t2 / 12 * (1 - t2 / 30 * (1 - t2 / 56 * (1 - t2 / 90 * (1 - t2 / 132))))),
            (1 - t2 / 20 * (1 - t2 / 42 * (1 - t2 / 72 * (1 - t2 / 110 * (1 - t2 / 156))))) / 6};
  }
  // By the half angle: 1 - cos keeps its digits at small θ, and one sine and cosine serve all three.
  const double half = std::sin(0.5 * theta);
  const double s = 2 * half * std::cos(0.5 * theta);
  return {s / theta, 2 * half * half / t2, (theta - s) / (t2 * theta)};
}

// exp(w) = cos θ 1 + sinc W + b w wᵀ, written out: this is the hot line of pose recovery.
Matrix3 Rotation(const Vector3& w, const Coefficients& k) {
  const double x = w.x(), y = w.y(), z = w.z();
  const double cosine = 1 - k.b * w.squaredNorm();
  const double xy = k.b * x * y, xz = k.b * x * z, yz = k.b * y * z;
  const double sx = k.sinc * x, sy = k.sinc * y, sz = k.sinc * z;
  Matrix3 R;
  R << cosine + k.b * x * x, xy - sz, xz + sy, xy + sz, cosine + k.b * y * y, yz - sx, xz - sy, yz + sx,
      cosine + k.b * z * z;
  return R;
}

// d/d(θ²)-type coefficients that the coupling block of Dexp needs:
//   b' = (db/dθ)/θ,  c' = (dc/dθ)/θ
struct Derivatives {
  double b_prime;
  double c_prime;
};

Derivatives EvaluateDerivatives(double theta, const Coefficients& k) {
  const double t2 = theta * theta;
  if (theta < 0.5) {
    // b = Σ (-1)^k t^{2k}/(2k+2)!,  c = Σ (-1)^k t^{2k}/(2k+3)!; differentiate term by term.
    double b_prime = 0, c_prime = 0, power = 1, factorial = 24;  // (2k+2)! at k = 1
    double sign = -1;
    for (int n = 1; n <= 9; ++n) {
      b_prime += sign * 2 * n * power / factorial;
      c_prime += sign * 2 * n * power / (factorial * (2 * n + 3));
      power *= t2;
      factorial *= (2 * n + 3) * (2 * n + 4);
      sign = -sign;
    }
    return {b_prime, c_prime};
  }
  return {(k.sinc - 2 * k.b) / t2, (k.b - 3 * k.c) / t2};
}

}  // namespace

RigidTransform::RigidTransform(const Quaternion& q, const Vector3& p)
    : R_(q.normalized().toRotationMatrix()), p_(p) {}

Quaternion RigidTransform::quaternion() const { return Quaternion(R_); }

void RigidTransform::Orthonormalize() { R_ = Quaternion(R_).normalized().toRotationMatrix(); }

// 0 times what is not finite is no number.
bool RigidTransform::IsFinite() const {
  const double* x = data();
  return (0 * QuadAt(x) + 0 * QuadAt(x + 4) + 0 * QuadAt(x + 8)).sum() == 0;
}

Matrix3 ExpRotation(const Vector3& w) { return Rotation(w, Evaluate(w.norm())); }

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
  const Coefficients k = Evaluate(w.norm());
  const Matrix3 W = Skew(w);
  return Matrix3::Identity() + k.b * W + k.c * (W * W);
}

Matrix3 DexpInverseRotation(const Vector3& w) {
  const double theta = w.norm();
  const double t2 = theta * theta;
  double d;  // (1 - θ/2 cot(θ/2)) / θ²
  if (theta < kSeriesAngle) {
    d = (1 + t2 / 60 * (1 + t2 / 42 * (1 + t2 / 40 * (1 + t2 * 10 / 396)))) / 12;
  } else {
    const double half = 0.5 * theta;
    d = (1 - half * std::cos(half) / std::sin(half)) / t2;
  }
  const Matrix3 W = Skew(w);
  return Matrix3::Identity() - 0.5 * W + d * (W * W);
}

RigidTransform Exp(const Vector6& x) {
  const Vector3 w = x.head<3>();
  const Vector3 v = x.tail<3>();
  const Coefficients k = Evaluate(w.norm());
  const Vector3 wv = w.cross(v);
  return {Rotation(w, k), Vector3(v + k.b * wv + k.c * w.cross(wv))};
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
  // Dexp = [J 0; Q J] with J = I + bW + cW² and Q the derivative of J(w) in the direction v.
  const Vector3 w = x.head<3>();
  const double theta = w.norm();
  const Coefficients k = Evaluate(theta);
  const Derivatives d = EvaluateDerivatives(theta, k);
  const Matrix3 W = Skew(w);
  const Matrix3 V = Skew(x.tail<3>());
  const Matrix3 W2 = W * W;
  const Matrix3 J = Matrix3::Identity() + k.b * W + k.c * W2;
  const double wv = w.dot(x.tail<3>());
  const Matrix3 Q = k.b * V + k.c * (W * V + V * W) + wv * (d.b_prime * W + d.c_prime * W2);
  Matrix6 A = Matrix6::Zero();
  A.topLeftCorner<3, 3>() = J;
  A.bottomRightCorner<3, 3>() = J;
  A.bottomLeftCorner<3, 3>() = Q;
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
