// How much harder a grasp may press, whatever the level of detail that simulates it.
#pragma once

#include <fork1s/diagnostics/load_factor.hpp>
#include <fork1s/sim/simulation.hpp>

namespace fork1s {

/// Of the contacts of the last step, frozen ones as if they rolled: docs/method.md, section 6. While contacts
/// are frozen, every mechanism is reduced again for it, which takes milliseconds.
LoadFactor ComputeLoadFactor(const Simulation& simulation);

}  // namespace fork1s
