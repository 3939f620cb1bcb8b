// Joints that may turn for ever without the reduced model growing old: wheels, rollers, propellers.
#pragma once

#include <fork1s/mechanism/rigid_parts.hpp>
#include <vector>

namespace fork1s::internal {

/// Per coordinate: whether nothing but the pose of its own body hangs on its displacement. The screws of
/// other joints do not, since none comes after it; nor do loops and tendons, which end elsewhere; nor
/// inertia, since what turns is as heavy all round its axis. An interface body's own last joint adds one
/// direction to what it may do, whatever its angle, so the basis stays what it was.
std::vector<char> FindSpinning(const Mechanism& mechanism, const RigidParts& parts,
                               const std::vector<BodyIndex>& interfaces);

}  // namespace fork1s::internal
