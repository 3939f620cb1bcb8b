#include <fork1s/spatial/spatial_inertia.hpp>

namespace fork1s {

Matrix6 SpatialInertia::Matrix() const {
  const Matrix3 c = Skew(center);
  Matrix6 I;
  I.topLeftCorner<3, 3>() = rotational - mass * c * c;
  I.topRightCorner<3, 3>() = mass * c;
  I.bottomLeftCorner<3, 3>() = -mass * c;
  I.bottomRightCorner<3, 3>() = mass * Matrix3::Identity();
  return I;
}

SpatialInertia Transform(const RigidTransform& X, const SpatialInertia& I) {
  return {I.mass, X * I.center, X.rotation() * I.rotational * X.rotation().transpose()};
}

// I (ω⁺ - ω)/t + ω̄ x I ω̄ = τ with ω̄ the mean.
Vector3 TurnFreely(const Matrix3& I, const Vector3& omega_B, const Vector3& torque_B, double t) {
  Vector3 next = omega_B;
  for (int i = 0; i < 8; ++i) {
    const Vector3 mean = 0.5 * (omega_B + next);
    const Vector3 residual = I * (next - omega_B) + t * (mean.cross(I * mean) - torque_B);
    if (residual.isZero(0)) break;
    Matrix3 jacobian = I + 0.5 * t * (Skew(mean) * I - Skew(I * mean));
    jacobian.diagonal().array() += 1e-12 * I.trace();  // a rod without thickness knows no turn about its axis
    const Vector3 step = jacobian.inverse() * residual;
    next -= step;
    if (step.squaredNorm() < 1e-28 * (1 + next.squaredNorm())) break;
  }
  return next;
}

}  // namespace fork1s
