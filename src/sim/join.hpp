// Mechanisms that hold a body together become one.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/mechanism/scene.hpp>
#include <fork1s/sim/fidelity.hpp>
#include <memory>
#include <vector>

namespace fork1s::internal {

/// Where every mechanism of the scene stands while these bodies are held. The one that takes the others in
/// has a driven base, or else a fixed one, or else it is the first: a base that floats joins on six free
/// coordinates, one that is fixed without any, and one that is driven not at all. Errors: kModel, for bases
/// that cannot be joined and for names that two of them share.
Expected<std::vector<MechanismPlace>> PlacesOf(const std::vector<std::shared_ptr<const Mechanism>>& given,
                                               const std::vector<FrozenGrasp>& holds);

/// The mechanism of the world that takes in what is held.
int MechanismThatHolds(const FrozenGrasp& hold, const std::vector<MechanismPlace>& places);

/// Joins them: `state`, of the scene with q in the order of `given`, becomes the same state of the new scene,
/// in which a mechanism that was taken in leaves an empty one in its place.
void JoinInScene(const std::vector<MechanismPlace>& places,
                 const std::vector<std::shared_ptr<const Mechanism>>& given, Scene& scene,
                 KeyframeDef& state);

}  // namespace fork1s::internal
