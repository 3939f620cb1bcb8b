// Poses, and the exponential map of SE(3) with its derivatives.
//
// Twists here are spatial: for X(t), Ẋ X⁻¹ = [V]. With x = [ω; v]:
//   Exp(x) = [ exp(ω) , V(ω) v ; 0 , 1 ],   V(ω) = Σ ω^k/(k+1)!
//   d/dt Exp(x) Exp(x)⁻¹ = [ dexp(x) ẋ ],   dexp(x) = Σ ad(x)^k/(k+1)!
#pragma once

#include <fork1s/base/types.hpp>

namespace fork1s {

/// Pose X_AB of frame B in frame A: p_A = R_AB p_B + p_AB.
class RigidTransform {
 public:
  RigidTransform() : R_(Matrix3::Identity()), p_(Vector3::Zero()) {}
  RigidTransform(const Matrix3& R, const Vector3& p) : R_(R), p_(p) {}
  RigidTransform(const Quaternion& q, const Vector3& p);
  explicit RigidTransform(const Vector3& p) : R_(Matrix3::Identity()), p_(p) {}

  static RigidTransform Identity() { return {}; }

  const Matrix3& rotation() const { return R_; }
  const Vector3& translation() const { return p_; }
  Matrix3& rotation() { return R_; }
  Vector3& translation() { return p_; }

  RigidTransform inverse() const {
    const Matrix3 Rt = R_.transpose();
    return {Rt, Vector3(-(Rt * p_))};
  }
  friend RigidTransform operator*(const RigidTransform& a, const RigidTransform& b) {
    return {Matrix3(a.R_ * b.R_), Vector3(a.R_ * b.p_ + a.p_)};
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

/// Adjoint(X) x without forming the 6x6.
inline Vector6 AdjointApply(const RigidTransform& X, const Vector6& x) {
  Vector6 y;
  y.head<3>().noalias() = X.rotation() * x.head<3>();
  y.tail<3>().noalias() = X.rotation() * x.tail<3>();
  y.tail<3>() += X.translation().cross(y.head<3>());
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
