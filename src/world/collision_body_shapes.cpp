#include "collision_body_shapes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fork1s {
namespace {

// Radius [m] of a sphere that the shape contains; of a mesh half of its least extent along the axes of its
// file.
struct InnerRadiusOf {
  double operator()(const Plane&) const { return std::numeric_limits<double>::infinity(); }
  double operator()(const Sphere& s) const { return s.radius; }
  double operator()(const Capsule& s) const { return s.radius; }
  double operator()(const Cylinder& s) const { return std::min(s.radius, s.half_length); }
  double operator()(const Ellipsoid& s) const { return s.radii.minCoeff(); }
  double operator()(const Box& s) const { return s.half.minCoeff(); }
  double operator()(const MeshShape& s) const {
    if (!s.mesh || s.mesh->vertices.empty()) return 0;
    Eigen::Vector3f least = s.mesh->vertices.front(), most = least;
    for (const auto& v : s.mesh->vertices) {
      least = least.cwiseMin(v);
      most = most.cwiseMax(v);
    }
    return 0.5 * static_cast<double>((most - least).minCoeff());
  }
  double operator()(const HeightField&) const { return std::numeric_limits<double>::infinity(); }
};

double Of(const std::vector<std::vector<double>>& radii, int collision_body, int geometry) {
  return radii[static_cast<std::size_t>(collision_body)][static_cast<std::size_t>(geometry)];
}

}  // namespace

void CollisionBodyShapes::Add(const CollisionBodyDef& body) {
  double farthest = 0;
  std::vector<double> outer, inner;
  for (const GeometryDef& g : body.geometries) {
    const double r = BoundingRadius(g.shape);
    if (std::isfinite(r)) farthest = std::max(farthest, g.X_BG.translation().norm() + r);
    if (body.moves) least_size = std::min(least_size, r);
    outer.push_back(r);
    inner.push_back(std::visit(InnerRadiusOf{}, g.shape));
  }
  radius.push_back(farthest);
  geometry_radius.push_back(std::move(outer));
  inner_radius.push_back(std::move(inner));
  geometries.push_back(body.geometries);
}

double CollisionBodyShapes::PairSize(const ContactPoint& p) const {
  return std::min(Of(geometry_radius, p.body_a, p.geometry_a), Of(geometry_radius, p.body_b, p.geometry_b));
}

double CollisionBodyShapes::InnerPairSize(const ContactPoint& p) const {
  return Of(inner_radius, p.body_a, p.geometry_a) + Of(inner_radius, p.body_b, p.geometry_b);
}

}  // namespace fork1s
