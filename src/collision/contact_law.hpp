// What a pair of shapes makes of their two materials.
#pragma once

#include <fork1s/collision/collision_world.hpp>

#include "model_text.hpp"

namespace fork1s::internal {

/// As in MJCF: the higher priority decides, else the larger coefficient, the more moments and the mean of
/// both damping ratios; a pair is frictionless when all who decide are.
void SetLaw(const CollisionGeom& a, const CollisionGeom& b, ContactPoint& out);
/// The law of an explicit contact pair.
void SetLaw(const ContactPairDef& pair, ContactPoint& out);
/// Why the numbers of a pair cannot be used; nullptr if they can.
const char* ProblemOf(const ContactPairDef& pair);

}  // namespace fork1s::internal
