// Joints whose displacement leaves the reduced coordinates as they are: wheels, wrists, turntables,
// shoulders.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>
#include <vector>

namespace fork1s {

/// Per coordinate [n]: whether a reduction about another displacement of this coordinate alone spans the same
/// motions. That holds for a joint of one freedom, without closure, coupling, path or nonlinear spring across
/// it, which is
///   the last joint of an interface body and carries nothing else: no screw depends on its displacement, and
///   forces on the body, inertia included, are Jᵀ f, whose static answers the attachment columns are; or
///   the root of its coordinate group: its motion moves all bodies of the group as one, which changes neither
///   joint inertias nor the row space of J, and turns the axes of weight into each other.
std::vector<char> FindInvariantJoints(const Mechanism& mechanism, const std::vector<BodyIndex>& interfaces);

}  // namespace fork1s
