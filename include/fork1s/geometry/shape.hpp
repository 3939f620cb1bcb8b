// Shapes as data. Each is given in its own frame; nothing here computes contacts.
#pragma once

#include <cstdint>
#include <fork1s/base/types.hpp>
#include <memory>
#include <string>
#include <variant>
#include <vector>

namespace fork1s {

/// Triangles over vertices [m]. Contact treats a mesh as its convex hull, as MuJoCo does.
struct TriangleMesh {
  std::string name;
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3i> triangles;
  /// Where a picture is seen: three a triangle, a corner each, (0, 0) being the picture's upper left and
  /// (1, 1) its lower right; or none.
  std::vector<Eigen::Vector2f> corner_uv;
};

/// What is drawn on a surface, again and again beyond its edges.
struct Picture {
  std::string name;
  int width = 0, height = 0;      // pixels
  std::vector<std::uint8_t> rgb;  // three bytes a pixel (sRGB), rows from the top
};

/// Heights over a regular grid, row-major from (-x, -y); heights [m] are above the frame's z = 0.
struct HeightGrid {
  std::string name;
  int rows = 0;
  int columns = 0;
  double half_x = 0;          // m
  double half_y = 0;          // m
  double max_height = 0;      // m, height of the value 1
  double base_depth = 0;      // m of solid ground below z = 0
  std::vector<float> values;  // in [0, 1]
};

struct Plane {
  double half_x = 0, half_y = 0;
};  ///< z = 0, solid below; 0 = infinite when drawn
struct Sphere {
  double radius = 0;
};
struct Capsule {
  double radius = 0, half_length = 0;
};  ///< along z; half_length without the caps
struct Cylinder {
  double radius = 0, half_length = 0;
};  ///< along z
struct Ellipsoid {
  Vector3 radii = Vector3::Zero();
};
struct Box {
  Vector3 half = Vector3::Zero();
};
struct MeshShape {
  std::shared_ptr<const TriangleMesh> mesh;
};
struct HeightField {
  std::shared_ptr<const HeightGrid> grid;
};

using Shape = std::variant<Plane, Sphere, Capsule, Cylinder, Ellipsoid, Box, MeshShape, HeightField>;

/// "sphere", "box", ... for messages and recordings.
const char* ShapeName(const Shape& shape);

/// Radius [m] of a sphere about the shape's origin that contains it; infinite for planes.
double BoundingRadius(const Shape& shape);

}  // namespace fork1s
