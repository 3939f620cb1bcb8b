// Curvature of a shape at a point of its surface.
#pragma once

#include <fork1s/geometry/shape.hpp>

namespace fork1s {

/// Symmetric 3x3 map [1/m] from a displacement along the surface to the change of the outward normal along
/// it, in the shape's frame; only what it has on the tangents counts; `p` and unit normal `n` in that frame.
/// Edges and corners count as radii of a micrometre, and so does every point of a mesh or height field, whose
/// curvature between facets nobody knows.
Matrix3 LocalCurvature(const Shape& shape, const Vector3& p, const Vector3& n);

}  // namespace fork1s
