#pragma once

#include "geometry/surface.hpp"

namespace fork1s::internal {

/// A mesh with normals, smooth across edges that bend by less than `crease` [rad] and sharp at the others.
/// Triangles without area are left out. Throws std::invalid_argument as MakeSurface does.
Surface WithNormals(const TriangleMesh& mesh, double crease);

}  // namespace fork1s::internal
