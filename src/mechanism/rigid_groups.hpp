// Bodies of a definition that move as one, and what of them may touch.
#pragma once

#include <fork1s/mechanism/definition.hpp>
#include <vector>

namespace fork1s::internal {

/// Per body: the one that the joints nearest to it move, or the base. Parents stand before their children.
std::vector<std::size_t> RigidGroups(const MechanismDef& mechanism);
bool HasColliders(const BodyDef& body);
/// Bodies with colliding shapes that move as one neither with the base, which always touches, nor with an interface body.
std::vector<BodyIndex> BodiesWithoutContact(const MechanismDef& mechanism,
                                            const std::vector<BodyIndex>& interfaces);

}  // namespace fork1s::internal
