// Shapes as triangles to draw.
#pragma once

#include <fork1s/geometry/shape.hpp>
#include <vector>

namespace fork1s {

/// Triangles [m] in the shape's own frame, counter-clockwise where seen from outside.
struct Surface {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3f> normals;    // one a vertex, unit, outwards
  std::vector<Eigen::Vector3i> triangles;  // vertex numbers
  std::vector<Eigen::Vector2f> uv;         // one a vertex, of meshes that have corner_uv; else none
};

struct SurfaceOptions {
  int sides = 32;          // of a full turn; a multiple of 4, so that the axes of a round shape are vertices
  double plane_half = 10;  // m, half size of a plane along axes where it is infinite
  double crease = 0.7;     // rad; mesh and heightfield edges that bend more than this are drawn sharp
};

/// The surface of a shape. Vertices lie on it, so what is round is drawn a little too small between them.
/// Heightfields without sides and bottom; empty for a mesh shape without mesh. Throws std::invalid_argument
/// for triangles that name vertices which their mesh lacks, grids whose values do not fill them and meshes
/// with numbers that are not finite.
Surface MakeSurface(const Shape& shape, const SurfaceOptions& options = {});

/// The upper side of a heightfield: its points row after row as the grid has them, two triangles between
/// four. Throws std::invalid_argument where the values are not rows times columns.
TriangleMesh GridTriangles(const HeightGrid& grid);

}  // namespace fork1s
