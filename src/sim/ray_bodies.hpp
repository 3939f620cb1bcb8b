// Bodies of a scene as rays see them.
#pragma once

#include <fork1s/collision/collision_world.hpp>
#include <fork1s/mechanism/scene.hpp>
#include <vector>

namespace fork1s::internal {

/// In the order of Simulation::bodies(): mechanism by mechanism, then free bodies; the world last.
inline std::vector<CollisionBodyDef> RayBodies(const Scene& scene) {
  std::vector<CollisionBodyDef> bodies;
  for (const MechanismDef& mechanism : scene.mechanisms)
    for (const BodyDef& body : mechanism.bodies) bodies.push_back({body.name, body.geometries, true, {}});
  for (const FreeBodyDef& body : scene.free_bodies) bodies.push_back({body.name, body.geometries, true, {}});
  bodies.push_back({"world", scene.world, false, {}});
  return bodies;
}

}  // namespace fork1s::internal
