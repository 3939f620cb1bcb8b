#include <fork1s/dynamics/contact_motion.hpp>

#include <algorithm>
#include <cmath>

#include "local_curvature.hpp"

namespace fork1s {
namespace {

Matrix3 InWorldAxes(const GeometryDef& geometry, const RigidTransform& X_WB, const Vector3& p,
                    const Vector3& outward) {
  const RigidTransform X_WG = X_WB * geometry.X_BG;
  const Matrix3& R = X_WG.rotation();
  return R * LocalCurvature(geometry.shape, X_WG.inverse() * p, R.transpose() * outward) * R.transpose();
}

// What touches a plane with a hull is one of its corners; elsewhere it may be a facet as well.
bool IsKnown(const Shape& shape, const Matrix3& of_other) {
  if (std::holds_alternative<HeightField>(shape)) return false;
  return !std::holds_alternative<MeshShape>(shape) || of_other.isZero(0);
}

}  // namespace

PairCurvature CurvatureOf(const GeometryDef& a, const RigidTransform& X_WA, const GeometryDef& b,
                          const RigidTransform& X_WB, const ContactPoint& point) {
  const Vector3 normal = point.frame.row(0).transpose();
  PairCurvature pair;
  pair.a = InWorldAxes(a, X_WA, point.point, normal);
  pair.b = InWorldAxes(b, X_WB, point.point, -normal);
  pair.known = IsKnown(a.shape, pair.b) && IsKnown(b.shape, pair.a);
  return pair;
}

CurvatureInverse InverseOf(const PairCurvature& curvature, const Matrix3& frame) {
  constexpr double kFlat = 1e-3;  // 1/m: radii of a kilometre
  using Matrix2 = Eigen::Matrix2d;
  const Eigen::Matrix<double, 2, 3> T = frame.bottomRows<2>();
  const Matrix2 S = T * (curvature.a + curvature.b) * T.transpose(), I = Matrix2::Identity();
  const double mean = 0.5 * S.trace(), spread = std::hypot(0.5 * (S(0, 0) - S(1, 1)), S(0, 1));
  const double most = mean + spread, least = mean - spread;
  Matrix2 inverse = Matrix2::Zero(), flat = I;
  if (least > kFlat) {
    inverse << S(1, 1), -S(0, 1), -S(1, 0), S(0, 0);
    inverse /= S(0, 0) * S(1, 1) - S(0, 1) * S(1, 0);
    flat.setZero();
  } else if (most > kFlat) {
    const Matrix2 bent = (S - least * I) / (most - least);
    inverse = bent / most;
    flat = I - bent;
  }
  return {T.transpose() * inverse * T, T.transpose() * flat * T};
}

ContactMotion MotionOf(const PairCurvature& curvature, const Matrix3& frame, const MaterialMotion& a,
                       const MaterialMotion& b) {
  const CurvatureInverse c = InverseOf(curvature, frame);
  const Vector3 n = frame.row(0).transpose();
  const Vector3 turn = (b.omega - a.omega).cross(n);
  Vector3 slip = b.velocity - a.velocity;
  slip -= n * n.dot(slip);
  // Where flat lies on flat nothing says which of the two carries the point: half of the slip each.
  const Vector3 u_a = c.inverse * (turn + curvature.b * slip) + 0.5 * (c.flat * slip);
  const Vector3 u_b = u_a - slip;
  const Vector3 n_dot = 0.5 * ((a.omega + b.omega).cross(n) + curvature.a * u_a - curvature.b * u_b);
  return {0.5 * (a.velocity + u_a + b.velocity + u_b), n.cross(n_dot)};
}

}  // namespace fork1s
