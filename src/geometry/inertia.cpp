// With the second moment C = ∫ x xᵀ dV / V about the centre, I = m (tr C 1 - C).
#include <fork1s/base/error.hpp>
#include <fork1s/geometry/inertia.hpp>

#include <cmath>
#include <numbers>

namespace fork1s {
namespace {

using std::numbers::pi;
// A closed surface has Σ area normal = 0. Vertices are floats: seven digits.
constexpr double kOpen = 1e-5;  // of the area

struct Solid {
  double volume = 0;                 // m³
  Matrix3 second = Matrix3::Zero();  // m², C about the centre
  Vector3 center = Vector3::Zero();  // m
};

// Of volume 0 where a size is not above 0.
Solid Symmetric(const Vector3& sizes, double volume, const Vector3& second) {
  if (!(sizes.array() > 0).all()) return {};
  return {volume, second.asDiagonal()};
}

struct SolidOf {
  const std::source_location& place;

  Solid operator()(const Sphere& s) const { return (*this)(Ellipsoid{Vector3::Constant(s.radius)}); }
  Solid operator()(const Ellipsoid& s) const {
    return Symmetric(s.radii, 4 * pi / 3 * s.radii.prod(), s.radii.cwiseAbs2() / 5);
  }
  Solid operator()(const Box& s) const {
    return Symmetric(s.half, 8 * s.half.prod(), s.half.cwiseAbs2() / 3);
  }
  Solid operator()(const Cylinder& s) const {
    const double across = s.radius * s.radius / 4;
    return Symmetric(Vector3(s.radius, s.radius, s.half_length), 2 * pi * s.radius * s.radius * s.half_length,
                     Vector3(across, across, s.half_length * s.half_length / 3));
  }
  // A cylinder, and two halves of a sphere, whose centres are 3/8 r beyond its ends.
  Solid operator()(const Capsule& s) const {
    const double r = s.radius, h = s.half_length;
    const double cylinder = 2 * pi * r * r * h, caps = 4 * pi / 3 * r * r * r, volume = cylinder + caps;
    const double across = (cylinder * r * r / 4 + caps * r * r / 5) / volume;
    const double along = (cylinder * h * h / 3 + caps * (r * r / 5 + h * h + 0.75 * h * r)) / volume;
    return Symmetric(Vector3(r, r, h), volume, Vector3(across, across, along));
  }
  // Tetrahedra from one vertex to all triangles, with the sign of their orientation.
  Solid operator()(const MeshShape& s) const {
    if (!s.mesh || s.mesh->triangles.empty()) return {};
    const TriangleMesh& mesh = *s.mesh;
    const Vector3 origin = mesh.vertices.front().cast<double>();
    double volume = 0, area = 0;
    Vector3 first = Vector3::Zero(), normal = Vector3::Zero();
    Matrix3 second = Matrix3::Zero();
    for (const Eigen::Vector3i& t : mesh.triangles) {
      Matrix3 x;
      for (int i = 0; i < 3; ++i) {
        internal::RequireIndex("vertex", t(i), mesh.vertices.size(), place);
        x.col(i) = mesh.vertices[static_cast<std::size_t>(t(i))].cast<double>() - origin;
      }
      const Vector3 n = (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0)) / 2, sum = x.rowwise().sum();
      const double v = x.determinant() / 6;
      volume += v;
      area += n.norm();
      normal += n;
      first += v / 4 * sum;
      second += v / 20 * (sum * sum.transpose() + x * x.transpose());
    }
    if (!(normal.norm() <= kOpen * area))
      internal::ThrowMisuse(place, "mesh '" + mesh.name +
                                       "' is not closed, or its triangles are not oriented alike; "
                                       "close it, or take the inertia of a simpler shape");
    const Vector3 center = first / volume;
    return {std::abs(volume), second / volume - center * center.transpose(), origin + center};
  }
  Solid operator()(const Plane&) const { return {}; }
  Solid operator()(const HeightField&) const { return {}; }
};

Solid ComputeSolid(const Shape& shape, const std::source_location& place) {
  const Solid solid = std::visit(SolidOf{place}, shape);
  if (!(solid.volume > 0 && std::isfinite(solid.volume)))  // 0 for planes and height fields too
    internal::ThrowMisuse(place, "a " + std::string(ShapeName(shape)) +
                                     " without a finite volume; give a solid "
                                     "with sizes above 0");
  return solid;
}

}  // namespace

double ComputeVolume(const Shape& shape) {
  return ComputeSolid(shape, std::source_location::current()).volume;
}

SpatialInertia ComputeInertia(const Shape& shape, double mass) {
  FORK1S_REQUIRE(mass > 0 && std::isfinite(mass), "a mass of", mass, "kg; give one above 0");
  const Solid solid = ComputeSolid(shape, std::source_location::current());
  return {mass, solid.center, mass * (solid.second.trace() * Matrix3::Identity() - solid.second)};
}

}  // namespace fork1s
