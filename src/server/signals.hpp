// Every number of a running simulation that can be plotted and is not told anyway.
#pragma once

#include <fork1s/sim/error_estimate.hpp>
#include <fork1s/sim/simulation.hpp>
#include <string>
#include <vector>

#include "server/tunables.hpp"

namespace fork1s::internal {

struct SignalInfo {
  std::string name, group, unit;  // group: "position", "joint_force", "actuator", "error"
  int body = -1;                  // on the wire: that the signal speaks of
};

/// In the order of MeasureSignals. At most 300 joint coordinates and as many actuators.
std::vector<SignalInfo> ListSignals(const Simulation& simulation);

/// Joint coordinates from the reference; what springs, dampers, servos and motors do to each of them; force
/// of every actuator along its own length, bounds included; estimated error of interface and free bodies, NaN
/// without `error`. Stops and dry friction are not in the joint forces.
void MeasureSignals(const Simulation& simulation, const std::vector<ServoShare>& servos,
                    const ErrorEstimate* error, std::vector<double>& out);

}  // namespace fork1s::internal
