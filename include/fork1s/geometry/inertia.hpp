// Volume and inertia of solid shapes.
#pragma once

#include <fork1s/geometry/shape.hpp>
#include <fork1s/spatial/spatial_inertia.hpp>

namespace fork1s {

/// Volume [m³]. Throws std::invalid_argument as ComputeInertia does.
double ComputeVolume(const Shape& shape);

/// Inertia of a solid of this mass [kg] and uniform density, in the frame of the shape; Transform(X_BG, ...)
/// gives it in the body's. A mesh counts as the volume that its triangles enclose, hollows and dents
/// included. Throws std::invalid_argument for planes and height fields, sizes and masses that are not above 0
/// and finite, and meshes that are not closed.
SpatialInertia ComputeInertia(const Shape& shape, double mass);

}  // namespace fork1s
