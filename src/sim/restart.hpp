// A simulation that goes on from a state that was set from outside.
#pragma once

#include <fork1s/sim/simulation.hpp>

namespace fork1s::internal {

struct Restarted {
  Simulation simulation;
  /// Largest difference [rad or m] between a joint coordinate of the state and what it became with loops closed.
  double change = 0;
};

/// A simulation with scene, options and controls of `from` that starts at `state`, of time 0. Controls of driven bases
/// count from their poses there. `num_keyframes`: how many keyframes the scene has by itself; the state is lent to it as
/// one more, in place of the one of a call before. Errors: as of Simulation::Create.
Expected<Restarted> RestartAt(const Simulation& from, const KeyframeDef& state, std::size_t num_keyframes);

}  // namespace fork1s::internal
