#include "mechanism/limits_at_start.hpp"

#include <fmt/format.h>
#include <fork1s/mechanism/kinematics.hpp>

#include <algorithm>

namespace fork1s::internal {

std::vector<std::string> DescribeStopsPassedAtStart(const Mechanism& mechanism, const VectorX& q) {
  constexpr double kWorthSaying = 1e-3;  // rad, or of the length scale: what is smaller is not seen to move
  std::vector<std::string> out;
  if (mechanism.length_limits().empty()) return out;
  Kinematics start(mechanism);
  ComputeKinematics(mechanism, q, start);
  for (const Mechanism::LengthLimit& limit : mechanism.length_limits()) {
    const double length = LengthOf(mechanism, limit.length, start, q);
    const double outside = std::max(limit.lower - length, length - limit.upper);
    const bool turns = mechanism.IsAngle(limit.length);
    if (outside > kWorthSaying * (turns ? 1 : mechanism.length_scale()))
      out.push_back(
          fmt::format("{} starts outside its limits by {:.4g} {}; it is brought inside at a bounded speed",
                      limit.WhatAndName(), outside, turns ? "rad" : "m"));
  }
  return out;
}

}  // namespace fork1s::internal
