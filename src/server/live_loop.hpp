// Sixty frames a second of a simulation that viewers touch.
#pragma once

#include <functional>

#include "server/live_server.hpp"
#include "server/live_simulation.hpp"

namespace fork1s {

/// Commands, steps, one snapshot, again and again as long as `go_on` says so, which is asked before every
/// frame and may change the simulation. The server's thread does the rest.
void RunLive(LiveSimulation& live, LiveServer& server, const std::function<bool()>& go_on);

}  // namespace fork1s
