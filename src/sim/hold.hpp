// Contacts frozen as joints: a held body becomes part of the mechanism that holds it.
#pragma once

#include <fork1s/dynamics/world.hpp>
#include <fork1s/sim/fidelity.hpp>
#include <string>

namespace fork1s::internal {

/// Free bodies that two or more bodies of one mechanism press on, at the contacts of the last step. `world`
/// was made of `scene`, h [s] is the length of that step. Those that several mechanisms hold are left out:
/// they would tie these together.
std::vector<Hold> FindHolds(const Scene& scene, const World& world, double h);

/// Which free body several mechanisms hold together, if any does, and what to do about it; else empty.
std::string HeldTogether(const Scene& scene, const World& world);

/// Takes what is held out of scene.free_bodies and into its mechanism, on a joint that leaves it free and one
/// closure per frozen contact. It becomes an interface body in place of those that hold it. `state` is a
/// state of the scene with q in the order of `given`, the scene's mechanisms as built, and becomes the same
/// state of the new scene. Errors as of BuildMechanism.
Expected<void> HoldInScene(const std::vector<Hold>& holds,
                           const std::vector<std::shared_ptr<const Mechanism>>& given, Scene& scene,
                           KeyframeDef& state);

/// Joint coordinates of `from` put where joints of the same name have theirs in `to`; others are 0.
VectorX CopyCoordinates(const Mechanism& from, const VectorX& q, const Mechanism& to);

/// Name of the closure of a contact, and of the joint, of what is held.
std::string HoldName(const std::string& held, std::size_t contact);

}  // namespace fork1s::internal
