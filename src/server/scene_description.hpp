// The part of the "scene" message that a live simulation and a recording share.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <nlohmann/json.hpp>
#include <string>

namespace fork1s::internal {

/// Roots, bodies, joints and screws. `separate`: every body a root of its own, for recordings that hold poses
/// only.
nlohmann::json DescribeScene(const Simulation& simulation, const std::string& title, std::uint32_t epoch,
                             bool separate);
std::string Dump(const nlohmann::json& json);

}  // namespace fork1s::internal
