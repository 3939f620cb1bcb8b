#include <fork1s/world/contact_motion.hpp>

#include <algorithm>
#include <cmath>

#include "local_curvature.hpp"

namespace fork1s {
namespace {

using Matrix2 = Eigen::Matrix2d;

Matrix2 OnTangents(const GeometryDef& geometry, const RigidTransform& X_WB, const ContactPoint& point,
                   double side) {
  if (std::holds_alternative<Plane>(geometry.shape)) return Matrix2::Zero();
  const RigidTransform X_WG = X_WB * geometry.X_BG;
  const Matrix3 frame_G = point.frame.lazyProduct(X_WG.rotation());
  const Vector3 p_G = X_WG.rotation().transpose().lazyProduct(point.point - X_WG.translation());
  const Matrix3 K = LocalCurvature(geometry.shape, p_G, side * frame_G.row(0).transpose());
  const Eigen::Matrix<double, 2, 3> T = frame_G.bottomRows<2>();
  return T.lazyProduct(K.lazyProduct(T.transpose()).eval());
}

// What touches a plane with a hull is one of its corners; elsewhere it may be a facet as well.
bool IsKnown(const Shape& shape, const Matrix2& of_other) {
  if (std::holds_alternative<HeightField>(shape)) return false;
  return !std::holds_alternative<MeshShape>(shape) || of_other.isZero(0);
}

}  // namespace

PairCurvature CurvatureOf(const GeometryDef& a, const RigidTransform& X_WA, const GeometryDef& b,
                          const RigidTransform& X_WB, const ContactPoint& point) {
  PairCurvature pair;
  pair.a = OnTangents(a, X_WA, point, 1);
  pair.b = OnTangents(b, X_WB, point, -1);
  pair.known = IsKnown(a.shape, pair.b) && IsKnown(b.shape, pair.a);
  return pair;
}

CurvatureInverse InverseOf(const PairCurvature& curvature) {
  constexpr double kFlat = 1e-3;  // 1/m: radii of a kilometre
  const Matrix2 S = curvature.a + curvature.b;
  const double mean = 0.5 * S.trace(), spread = std::hypot(0.5 * (S(0, 0) - S(1, 1)), S(0, 1));
  const double most = mean + spread, least = mean - spread;
  CurvatureInverse out;
  if (least > kFlat) {
    out.inverse << S(1, 1), -S(0, 1), -S(1, 0), S(0, 0);
    out.inverse /= S(0, 0) * S(1, 1) - S(0, 1) * S(1, 0);
    out.flat.setZero();
  } else if (most > kFlat) {
    const Matrix2 bent = (S - least * Matrix2::Identity()) / (most - least);
    out.inverse = bent / most;
    out.flat -= bent;
  }
  return out;
}

ContactMotion MotionOf(const PairCurvature& curvature, const CurvatureInverse& inverse, const Matrix3& frame,
                       const MaterialMotion& a, const MaterialMotion& b) {
  const Vector3 n = frame.row(0).transpose();
  const Eigen::Matrix<double, 2, 3> T = frame.bottomRows<2>();
  const Vector2 turn = T.lazyProduct((b.omega - a.omega).cross(n)),
                slip = T.lazyProduct(b.velocity - a.velocity);
  // Where flat lies on flat nothing says which of the two carries the point: half of the slip each.
  const Vector2 u_a = inverse.inverse.lazyProduct(turn + curvature.b.lazyProduct(slip)) +
                      0.5 * inverse.flat.lazyProduct(slip);
  const Vector2 u_b = u_a - slip;
  const Vector2 bend = curvature.a.lazyProduct(u_a) - curvature.b.lazyProduct(u_b);
  const Vector3 n_dot = 0.5 * ((a.omega + b.omega).cross(n) + T.transpose().lazyProduct(bend));
  return {0.5 * (a.velocity + b.velocity + T.transpose().lazyProduct(u_a + u_b)), n.cross(n_dot)};
}

}  // namespace fork1s
