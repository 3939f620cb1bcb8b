// The shapes of what touches, as they were built.
#pragma once

#include <fork1s/collision/collision_world.hpp>
#include <limits>
#include <vector>

namespace fork1s {

/// Per collision body, in its frame.
struct CollisionBodyShapes {
  /// With the next collision body's; its index is that in World::collision_bodies().
  void Add(const CollisionBodyDef& body);
  /// Radius [m] of the smaller of two shapes that touch.
  double PairSize(const ContactPoint& point) const;
  /// Sum [m] of the radii of spheres within the two.
  double InnerPairSize(const ContactPoint& point) const;

  std::vector<std::vector<GeometryDef>> geometries;
  std::vector<double> radius;                        // m, about the collision body's frame; no planes
  std::vector<std::vector<double>> geometry_radius;  // m, per geometry; infinite for planes
  std::vector<std::vector<double>> inner_radius;     // m, per geometry, of a sphere within
  double least_size = std::numeric_limits<double>::infinity();  // m, of the shapes that move
};

}  // namespace fork1s
