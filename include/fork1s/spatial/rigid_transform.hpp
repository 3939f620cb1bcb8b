// Poses, and the exponential map of SE(3) with its derivatives.
//
// Twists here are spatial: for X(t), Ẋ X⁻¹ = [V]. With x = [ω; v]:
//   Exp(x) = [ exp(ω) , V(ω) v ; 0 , 1 ],   V(ω) = Σ ω^k/(k+1)!
//   d/dt Exp(x) Exp(x)⁻¹ = [ dexp(x) ẋ ],   dexp(x) = Σ ad(x)^k/(k+1)!
#pragma once

#include <fork1s/base/quad.hpp>
#include <fork1s/base/types.hpp>

namespace fork1s {

/// Pose X_AB of frame B in frame A: p_A = R_AB p_B + p_AB.
class RigidTransform {
 public:
  RigidTransform() : R_(Matrix3::Identity()), p_(Vector3::Zero()) {}
  RigidTransform(const Matrix3& R, const Vector3& p) : R_(R), p_(p) {}
  RigidTransform(const Quaternion& q, const Vector3& p);
  explicit RigidTransform(const Vector3& p) : R_(Matrix3::Identity()), p_(p) {}

  /// One whose numbers are still to be written.
  struct Unset {};
  explicit RigidTransform(Unset) {}

  static RigidTransform Identity() { return {}; }

  const Matrix3& rotation() const { return R_; }
  const Vector3& translation() const { return p_; }
  Matrix3& rotation() { return R_; }
  Vector3& translation() { return p_; }

  RigidTransform inverse() const {
    const Matrix3 Rt = R_.transpose();
    return {Rt, Vector3(-(Rt * p_))};
  }
  /// The twelve numbers of [R p], column by column.
  const double* data() const { return reinterpret_cast<const double*>(this); }
  double* data() { return reinterpret_cast<double*>(this); }

  friend RigidTransform operator*(const RigidTransform& a, const RigidTransform& b) {
    RigidTransform out{Unset()};
    SetProduct(a, b, out);
    return out;
  }
  /// out <- a b, another one than these two. Columns go four numbers at a time: the fourth is the next column's
  /// first, which is written after it.
  friend void SetProduct(const RigidTransform& a, const RigidTransform& b, RigidTransform& out) {
    const double *A = a.data(), *B = b.data();
    const Quad x = QuadAt(A), y = QuadAt(A + 3), z = QuadAt(A + 6);
    double* to = out.data();
    for (int column = 0; column < 3; ++column, B += 3, to += 3) QuadAt(to) = B[0] * x + B[1] * y + B[2] * z;
    out.p_ = a.R_.lazyProduct(b.p_) + a.p_;
  }
  /// Maps a point given in B to A.
  Vector3 operator*(const Vector3& point) const { return R_ * point + p_; }

  Quaternion quaternion() const;
  /// Removes the rounding that products of many poses gather in the rotation.
  void Orthonormalize();
  bool IsFinite() const;

 private:
  Matrix3 R_;
  Vector3 p_;
};
static_assert(sizeof(RigidTransform) == 12 * sizeof(double));

/// [v]x, so that Skew(a) b = a x b.
inline Matrix3 Skew(const Vector3& v) {
  Matrix3 m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// exp: rotation vector [rad] to rotation matrix.
Matrix3 ExpRotation(const Vector3& rotation_vector);
/// Inverse of ExpRotation; length in [0, π], right to rounding near 0 and near π.
Vector3 LogRotation(const Matrix3& R);
/// Left Jacobian of SO(3): d/dt exp(φ) exp(φ)ᵀ = [DexpRotation(φ) φ̇]x.
Matrix3 DexpRotation(const Vector3& rotation_vector);
Matrix3 DexpInverseRotation(const Vector3& rotation_vector);

/// Exponential of a twist [ω; v] (rad, m).
RigidTransform Exp(const Vector6& x);
/// Inverse of Exp; rotation part of length in [0, π].
Vector6 Log(const RigidTransform& X);
/// 6x6 adjoint: a twist given in B becomes the same twist in A, for X_AB.
Matrix6 Adjoint(const RigidTransform& X);
/// ad(x) y = [x, y], the Lie bracket of two twists.
Matrix6 SmallAdjoint(const Vector6& x);
/// Left derivative of Exp: d/dt Exp(x) Exp(x)⁻¹ = [Dexp(x) ẋ].
Matrix6 Dexp(const Vector6& x);
Matrix6 DexpInverse(const Vector6& x);

/// A twist or wrench in axes of A, about the same point, for R_AB.
inline Vector6 InAxes(const Matrix3& R, const Vector6& x) {
  Vector6 y;
  y << R * x.head<3>(), R * x.tail<3>();
  return y;
}
/// Adjoint(X) x without forming the 6x6.
inline Vector6 AdjointApply(const RigidTransform& X, const Vector6& x) {
  const double* R = X.data();
  const Quad first = QuadAt(R), second = QuadAt(R + 3), third = QuadAt(R + 6);
  const Quad turned = x[0] * first + x[1] * second + x[2] * third,
             moved = x[3] * first + x[4] * second + x[5] * third;
  Vector6 y;
  y << turned.head<3>(), moved.head<3>() + X.translation().cross(turned.head<3>());
  return y;
}
/// Adjoint(X)ᵀ F: a wrench in A becomes the same wrench in B, for X_AB.
inline Vector6 AdjointTransposeApply(const RigidTransform& X, const Vector6& F) {
  Vector6 y;
  y.head<3>().noalias() = X.rotation().transpose() * (F.head<3>() - X.translation().cross(F.tail<3>()));
  y.tail<3>().noalias() = X.rotation().transpose() * F.tail<3>();
  return y;
}
/// [x, y]
inline Vector6 Bracket(const Vector6& x, const Vector6& y) {
  Vector6 r;
  r.head<3>() = x.head<3>().cross(y.head<3>());
  r.tail<3>() = x.head<3>().cross(y.tail<3>()) + x.tail<3>().cross(y.head<3>());
  return r;
}

}  // namespace fork1s
