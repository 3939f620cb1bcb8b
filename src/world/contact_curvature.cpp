#include "world/contact_curvature.hpp"

#include <algorithm>
#include <cmath>

#include "detail.hpp"

namespace fork1s {
namespace {

constexpr double kSharp = 1e6;  // curvature of an edge times the size of the smaller shape
// Distance from an edge, as a share of the shape's extent, within which a point is on it. Points stand midway between
// two surfaces that overlap: by a ten thousandth of it at rest, by more while something lands.
constexpr double kOnEdge = 2e-3;
constexpr double kFlat =
    1e-9;  // least curvature over the largest: rounding of a tangent along a cylinder leaves 1e-16

// Symmetric 3x3 map [1/m] from a displacement along the surface to the change of the outward normal along it, at point
// p with outward normal n in the shape's frame; only what it has on the tangents counts.
struct LocalCurvature {
  const Vector3& p;
  const Vector3& n;
  double sharp;  // 1/m

  static Matrix3 AcrossZ() { return Vector3(1, 1, 0).asDiagonal(); }

  Matrix3 operator()(const Plane&) const { return Matrix3::Zero(); }
  Matrix3 operator()(const Sphere& s) const { return Matrix3::Identity() / s.radius; }
  Matrix3 operator()(const Capsule& s) const {
    return (std::abs(p.z()) > s.half_length ? Matrix3(Matrix3::Identity()) : AcrossZ()) / s.radius;
  }
  Matrix3 operator()(const Cylinder& s) const {
    const double rho = p.head<2>().norm();
    const bool end = std::abs(p.z()) > (1 - kOnEdge) * s.half_length, side = rho > (1 - kOnEdge) * s.radius;
    if (!end) return AcrossZ() / s.radius;
    if (!side) return Matrix3::Zero();
    const Vector3 around = Vector3(-p.y(), p.x(), 0) / rho;
    const Matrix3 along = around * around.transpose();
    // The rim is a circle: along it the normal turns only by its radial share.
    return sharp * (Matrix3::Identity() - along) + n.head<2>().norm() / s.radius * along;
  }
  Matrix3 operator()(const Ellipsoid& s) const {
    const Vector3 w = s.radii.cwiseInverse().cwiseAbs2();
    return Matrix3(w.asDiagonal()) / w.cwiseProduct(p).norm();
  }
  Matrix3 operator()(const Box& s) const {
    Vector3 across = Vector3::Zero();  // axes of the faces that the point is on
    for (int i = 0; i < 3; ++i)
      if (std::abs(p(i)) > (1 - kOnEdge) * s.half(i)) across(i) = 1;
    if (across.sum() < 2) return Matrix3::Zero();
    return sharp * Matrix3(across.asDiagonal());
  }
  Matrix3 operator()(const MeshShape&) const { return sharp * Matrix3::Identity(); }
  Matrix3 operator()(const HeightField&) const { return sharp * Matrix3::Identity(); }
};

Eigen::Matrix2d OnTangents(const GeometryDef& geometry, const RigidTransform& X_WB, const ContactPoint& point,
                           double side, double size) {
  if (std::holds_alternative<Plane>(geometry.shape)) return Eigen::Matrix2d::Zero();
  const RigidTransform X_WG = X_WB * geometry.X_BG;
  const Matrix3 frame_G = point.frame.lazyProduct(X_WG.rotation());
  const Vector3 p_G = X_WG.rotation().transpose().lazyProduct(point.point - X_WG.translation());
  const Vector3 n_G = side * frame_G.row(0).transpose();
  const Matrix3 K = std::visit(LocalCurvature{p_G, n_G, kSharp / size}, geometry.shape);
  const Eigen::Matrix<double, 2, 3> T = frame_G.bottomRows<2>();
  return T.lazyProduct(K.lazyProduct(T.transpose()).eval());
}

}  // namespace

PairCurvature ComputeCurvature(const GeometryDef& a, const RigidTransform& X_WA, const GeometryDef& b,
                               const RigidTransform& X_WB, const ContactPoint& point, double size) {
  return {OnTangents(a, X_WA, point, 1, size), OnTangents(b, X_WB, point, -1, size)};
}

CurvatureInverse Invert(const PairCurvature& curvature) {
  using Matrix2 = Eigen::Matrix2d;
  const Matrix2 S = curvature.a + curvature.b;
  const double mean = 0.5 * S.trace(), spread = std::hypot(0.5 * (S(0, 0) - S(1, 1)), S(0, 1));
  const double most = mean + spread, least = mean - spread;
  CurvatureInverse out;
  if (!(most > 0)) return out;
  if (least > kFlat * most) {
    out.inverse << S(1, 1), -S(0, 1), -S(1, 0), S(0, 0);
    out.inverse /= S(0, 0) * S(1, 1) - S(0, 1) * S(1, 0);
    out.flat.setZero();
  } else {
    const Matrix2 bent = (S - least * Matrix2::Identity()) / (most - least);
    out.inverse = bent / most;
    out.flat -= bent;
  }
  return out;
}

Matrix3 ComputeInverseCurvature(const GeometryDef& a, const RigidTransform& X_WA, const GeometryDef& b,
                                const RigidTransform& X_WB, const ContactPoint& point, double size) {
  const Eigen::Matrix<double, 2, 3> tangents = point.frame.bottomRows<2>();
  return tangents.transpose() * Invert(ComputeCurvature(a, X_WA, b, X_WB, point, size)).inverse * tangents;
}

Matrix3 ComputeInverseCurvature(const World& world, const ContactPoint& p) {
  const auto pose = [&](int body) {
    const CollisionBody& c = world.collision_bodies()[static_cast<std::size_t>(body)];
    const auto i = static_cast<std::size_t>(c.index);
    if (c.kind == CollisionBody::Kind::kFreeBody) return world.free_bodies()[i].pose();
    if (body == 0) return RigidTransform();  // the scene's own still geometry comes first
    return GroupPose(world.mechanisms()[i], c.group);
  };
  return ComputeInverseCurvature(world.geometry(p.body_a, p.geometry_a), pose(p.body_a),
                                 world.geometry(p.body_b, p.geometry_b), pose(p.body_b), p,
                                 world.PairSize(p));
}

}  // namespace fork1s
