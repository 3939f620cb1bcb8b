#include <fork1s/geometry/shape.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace fork1s {
namespace {

struct NameOf {
  const char* operator()(const Plane&) const { return "plane"; }
  const char* operator()(const Sphere&) const { return "sphere"; }
  const char* operator()(const Capsule&) const { return "capsule"; }
  const char* operator()(const Cylinder&) const { return "cylinder"; }
  const char* operator()(const Ellipsoid&) const { return "ellipsoid"; }
  const char* operator()(const Box&) const { return "box"; }
  const char* operator()(const MeshShape&) const { return "mesh"; }
  const char* operator()(const HeightField&) const { return "heightfield"; }
};

struct RadiusOf {
  double operator()(const Plane&) const { return std::numeric_limits<double>::infinity(); }
  double operator()(const Sphere& s) const { return s.radius; }
  double operator()(const Capsule& s) const { return s.radius + s.half_length; }
  double operator()(const Cylinder& s) const { return std::hypot(s.radius, s.half_length); }
  double operator()(const Ellipsoid& s) const { return s.radii.maxCoeff(); }
  double operator()(const Box& s) const { return s.half.norm(); }
  double operator()(const MeshShape& s) const {
    double r2 = 0;
    if (s.mesh)
      for (const auto& v : s.mesh->vertices) r2 = std::max(r2, static_cast<double>(v.squaredNorm()));
    return std::sqrt(r2);
  }
  double operator()(const HeightField& s) const {
    if (!s.grid) return 0;
    return std::hypot(std::hypot(s.grid->half_x, s.grid->half_y),
                      std::max(s.grid->max_height, s.grid->base_depth));
  }
};

}  // namespace

const char* ShapeName(const Shape& shape) { return std::visit(NameOf{}, shape); }
double BoundingRadius(const Shape& shape) { return std::visit(RadiusOf{}, shape); }

}  // namespace fork1s
