// What a mechanism stands on.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>
#include <string>

#include "output.hpp"

namespace fork1s::app {

/// Puts `base`, `free_joint_bodies` and `is_free` into the object of a mechanism: the kind of its base, the bodies
/// that a free joint joins to a base, and whether no other joints join bodies to a base that is still.
void PutBase(const Mechanism& mechanism, Json& out);
/// These in words: "base fixed", "base fixed, 'load' on a free joint", or, where every joint of the base is a free
/// joint, "free body 'load'" and "free bodies 'load' and 'hook'".
std::string BaseText(const Json& mechanism);

}  // namespace fork1s::app
