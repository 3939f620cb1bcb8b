// Limits of lengths that a pose does not meet.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>
#include <string>
#include <vector>

namespace fork1s::internal {

/// A sentence for each stop that a simulation which starts at `q` finds passed by more than a thousandth of a radian or
/// of the mechanism's length. It is brought inside at the speed at which bodies that overlap are parted.
std::vector<std::string> DescribeStopsPassedAtStart(const Mechanism& mechanism, const VectorX& q);

}  // namespace fork1s::internal
