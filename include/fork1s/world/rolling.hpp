// How far a contact point migrates when one surface rolls on the other.
#pragma once

#include <fork1s/world/world.hpp>

namespace fork1s {

/// (κ_a + κ_b)⁻¹ [m] on the tangent plane of a contact at the present poses, world axes, zero along the
/// normal: when b turns against a by φ, the point moves along both surfaces by this times φ x n. Zero in
/// directions in which flat lies on flat, where further contacts hold the turn. docs/method.md, (6.2).
Matrix3 InverseCurvature(const World& world, const ContactPoint& point);

}  // namespace fork1s
