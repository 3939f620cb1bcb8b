// JSON messages that more than one file of this room writes.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <nlohmann/json.hpp>
#include <string>

namespace fork1s::internal {

/// Names, roots, bodies, joints and screws: what the "scene" messages of a live simulation and of a recording
/// share. `geometry`: version of the shapes that belong to it. `separate`: every body a root of its own, for
/// recordings that hold poses only.
nlohmann::json DescribeScene(const Simulation& simulation, const std::string& title, std::uint32_t epoch,
                             std::uint32_t geometry, bool separate);
/// Text that is no UTF-8 becomes replacement characters.
std::string Dump(const nlohmann::json& json);
/// A sentence that stays on the page; an empty one takes away what was said about the same thing.
std::string ProblemMessage(const std::string& about, const std::string& sentence);

}  // namespace fork1s::internal
