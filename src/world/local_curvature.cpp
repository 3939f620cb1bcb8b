#include "local_curvature.hpp"

#include <cmath>

namespace fork1s {
namespace {

constexpr double kSharp = 1e6;  // 1/m
// Points stand midway between two surfaces that overlap, by 10 µm at rest, by more while something lands.
constexpr double kOnEdge = 2e-4;  // m

struct AtPoint {
  const Vector3& p;
  const Vector3& n;

  static Matrix3 AcrossZ() { return Vector3(1, 1, 0).asDiagonal(); }

  Matrix3 operator()(const Plane&) const { return Matrix3::Zero(); }
  Matrix3 operator()(const Sphere& s) const { return Matrix3::Identity() / s.radius; }
  Matrix3 operator()(const Capsule& s) const {
    return (std::abs(p.z()) > s.half_length ? Matrix3(Matrix3::Identity()) : AcrossZ()) / s.radius;
  }
  Matrix3 operator()(const Cylinder& s) const {
    const double rho = p.head<2>().norm();
    const bool end = std::abs(p.z()) > s.half_length - kOnEdge, side = rho > s.radius - kOnEdge;
    if (!end) return AcrossZ() / s.radius;
    if (!side) return Matrix3::Zero();
    const Vector3 around = Vector3(-p.y(), p.x(), 0) / rho;
    const Matrix3 along = around * around.transpose();
    // The rim is a circle: along it the normal turns only by its radial share.
    return kSharp * (Matrix3::Identity() - along) + n.head<2>().norm() / s.radius * along;
  }
  Matrix3 operator()(const Ellipsoid& s) const {
    const Vector3 w = s.radii.cwiseInverse().cwiseAbs2();
    return Matrix3(w.asDiagonal()) / w.cwiseProduct(p).norm();
  }
  Matrix3 operator()(const Box& s) const {
    int faces = 0;
    Vector3 free = Vector3::Ones();
    for (int i = 0; i < 3; ++i)
      if (std::abs(p(i)) > s.half(i) - kOnEdge) {
        ++faces;
        free(i) = 0;
      }
    if (faces < 2) return Matrix3::Zero();
    return kSharp * Matrix3(Vector3(Vector3::Ones() - free).asDiagonal());
  }
  Matrix3 operator()(const MeshShape&) const { return kSharp * Matrix3::Identity(); }
  Matrix3 operator()(const HeightField&) const { return kSharp * Matrix3::Identity(); }
};

}  // namespace

Matrix3 LocalCurvature(const Shape& shape, const Vector3& p, const Vector3& n) {
  return std::visit(AtPoint{p, n}, shape);
}

}  // namespace fork1s
