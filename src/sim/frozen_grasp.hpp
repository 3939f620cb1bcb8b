// Contacts frozen as joints: a held body becomes part of the mechanism that holds it.
#pragma once

#include <fork1s/sim/fidelity.hpp>
#include <fork1s/world/world.hpp>
#include <string>

#include "join.hpp"

namespace fork1s::internal {

/// Free bodies that two or more bodies of mechanisms press on, at the contacts of the last step. `world` was
/// made of `scene`, in which nothing is held; h [s] is the length of that step.
std::vector<FrozenGrasp> FindFrozenGrasps(const Scene& scene, const World& world, double h);

/// Takes what is held out of scene.free_bodies and into the mechanism that holds it, on a joint that leaves
/// it free and one closure per frozen contact. It becomes an interface body in place of those that hold it.
/// Mechanisms that hold it together are joined (PlacesOf). `state` is a state of the scene with q in the
/// order of `given`, the scene's mechanisms as built, and becomes the same state of the new scene.
void FreezeInScene(const std::vector<FrozenGrasp>& holds, const std::vector<MechanismPlace>& places,
                   const std::vector<std::shared_ptr<const Mechanism>>& given, Scene& scene,
                   KeyframeDef& state);

/// Name of the closure of a contact, and of the joint, of what is held.
std::string HoldName(const std::string& held, std::size_t contact);

}  // namespace fork1s::internal
