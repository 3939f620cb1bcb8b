// What the archive of a functional mock-up unit holds of the model: the scene as it was read from its file, meshes
// included, and the options of its simulation.
#pragma once

#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>
#include <map>
#include <string>
#include <vector>

namespace fork1s::fmi {

struct UnitModel {
  ImportedScene imported;
  SimulationOptions options;
  std::vector<int> bodies;  // that have variables: places in Simulation::bodies()
};

/// Errors: kFile, with the remedy.
Expected<std::string> ReadFile(const std::string& path, const char* remedy);
/// Contents of files by their names. Pictures are left out.
std::map<std::string, std::string> WriteResources(const UnitModel& model);
/// Every double to its last bit. Errors: kFile, kFormat.
Expected<UnitModel> ReadResources(const std::string& folder);
/// Tells two contents from each other: 128 bits of them as {xxxxxxxx-xxxx-...}.
std::string TokenOf(const std::map<std::string, std::string>& resources);
Expected<std::string> ReadToken(const std::string& folder);

}  // namespace fork1s::fmi
