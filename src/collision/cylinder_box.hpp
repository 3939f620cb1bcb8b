// A cylinder and a box or a capsule, in closed form but for the rim against an edge.
#pragma once

#include <optional>

#include "box_box.hpp"

namespace fork1s::internal {

/// Cylinder of this radius and half length [m] along z of X_A, box of these half sizes; frames in the world; normal from
/// the cylinder to the box. The gap is `margin` or more where the shapes are farther apart, and then nothing else of the
/// result is known. Empty where no pair of features is found that certifies itself.
std::optional<Deepest> CylinderBox(double radius, double half_length, const RigidTransform& X_A,
                                   const Vector3& half, const RigidTransform& X_B, double margin);
/// The same of a capsule of this radius, its segment of this half length along z of X_B; normal from the cylinder to it.
std::optional<Deepest> CylinderCapsule(double radius, double half_length, const RigidTransform& X_A,
                                       double capsule_radius, double capsule_half_length,
                                       const RigidTransform& X_B, double margin);

}  // namespace fork1s::internal
