// What MuJoCo computes by other laws than we do, in words.
#pragma once

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

namespace fork1s::internal {

/// Sentences on contact, friction and loops, of what the file's options make of them.
std::vector<std::string> MuJoCoLaws(const mjModel* m);

}  // namespace fork1s::internal
