// Which joint coordinates depend on each other.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>
#include <vector>

namespace fork1s::internal {

/// Joint coordinates that joints on one path, loops, couplings or springs join, ascending, in the order of
/// their first. While the base is held or driven, what one group does no other depends on: fingers of a hand on
/// its wrist.
std::vector<std::vector<int>> CoordinateGroups(const Mechanism& mechanism);

/// The same by loops, couplings and springs alone, whatever joints carry each other: which motions are closed
/// and which stretch springs each of these decides for itself. Finer.
std::vector<std::vector<int>> StaticGroups(const Mechanism& mechanism);

/// Per coordinate [n]: whether a closure, coupling, path or nonlinear spring acts across it, whose rows or
/// stiffness depend on its displacement.
std::vector<char> FindPoseDependent(const Mechanism& mechanism);

}  // namespace fork1s::internal
