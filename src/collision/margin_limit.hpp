// How far ahead the detector can be trusted.
#pragma once

#include <mujoco/mujoco.h>

namespace fork1s::internal {

/// Largest margin [m] for a pair of geometries. MuJoCo finds general convex pairs (ellipsoids, cylinders,
/// meshes and all against height fields) by shapes inflated by the margin: an ellipsoid of 0.1 m at 5 mm over
/// a box is found at +5.00 mm with a margin of 50 mm, and at -532 mm with one of 200 mm. Pairs with closed
/// forms have no limit.
double MarginLimit(const mjModel* model, int geom1, int geom2);
/// The smallest of all pairs that may occur.
double MarginLimit(const mjModel* model);

}  // namespace fork1s::internal
