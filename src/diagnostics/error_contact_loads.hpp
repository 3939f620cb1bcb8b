// Contact forces of a step as wrenches on bodies.
#pragma once

#include <fork1s/world/world.hpp>
#include <vector>

namespace fork1s {

/// [moment about the world's origin; force] in world axes.
struct ContactLoads {
  std::vector<Matrix6X> mechanisms;  // 6 x bodies each
  std::vector<Vector6> free_bodies;
};
ContactLoads LoadsOf(const World& world, const std::vector<ContactRecord>& contacts, double h);

/// Contacts moved to the nearest of `points` of the same pair of shapes: what slides takes its force along.
std::vector<ContactRecord> MovedTo(const std::vector<ContactPoint>& points,
                                   std::vector<ContactRecord> contacts);

}  // namespace fork1s
