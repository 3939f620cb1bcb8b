// Two boxes, exactly: MuJoCo's own routine for them overlooks corners and edges while they are apart.
#pragma once

#include <fork1s/spatial/rigid_transform.hpp>

namespace fork1s::internal {

/// Where two convex shapes come nearest to each other, or lie deepest in each other.
struct Deepest {
  double gap = 0;                     // m, negative in penetration
  Vector3 normal = Vector3::UnitZ();  // unit, from a to b
  Vector3 point = Vector3::Zero();    // midway between the surfaces
};

/// Boxes of the given half sizes; frames in the world. False when the gap is `margin` or more.
bool BoxBox(const Vector3& half_a, const RigidTransform& X_A, const Vector3& half_b,
            const RigidTransform& X_B, double margin, Deepest& deepest);

}  // namespace fork1s::internal
