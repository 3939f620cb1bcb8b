// Models and simulations as bytes, every double to its last bit, on their way between processes of one version.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>
#include <optional>
#include <string>
#include <vector>

namespace fork1s {

/// Scene, report and initial keyframe, with the options they were read with, if any.
struct ModelContent {
  ImportedScene imported;
  std::optional<ImportOptions> options;
};
std::string WriteModelBytes(const ModelContent& content);
/// Errors (kFormat): bytes that are damaged or cut off, or that another version wrote.
Expected<ModelContent> ReadModelBytes(const std::string& bytes, const std::string& where);

/// What Simulation::Create and Restore need, and the actuators that belong to the scene.
struct SimulationContent {
  Scene scene;
  SimulationOptions options;
  std::vector<SensorDef> actuators;
  Simulation::Snapshot snapshot;
};
std::string WriteSimulationBytes(const SimulationContent& content);
/// Errors: as of ReadModelBytes; kModel where a mechanism cannot be built.
Expected<SimulationContent> ReadSimulationBytes(const std::string& bytes, const std::string& where);

std::string WriteSnapshotBytes(const Simulation::Snapshot& snapshot);
/// Errors likewise.
Expected<Simulation::Snapshot> ReadSnapshotBytes(const std::string& bytes, const std::string& where);

/// Options of the simulations of a batch, and the moment of each, without its scene where that is the one it began with.
struct BatchContent {
  SimulationOptions options;
  std::vector<Simulation::Snapshot> snapshots;
};
std::string WriteBatchBytes(const BatchContent& content);
/// Each moment without a scene is to be completed by CompleteSnapshot. Errors likewise.
Expected<BatchContent> ReadBatchBytes(const std::string& bytes, const std::string& where);
/// Gives a moment of a batch scene and mechanisms: those of `made`, of the simulation as it was made. Errors: kFormat
/// where it has other mechanisms.
Expected<void> CompleteSnapshot(const Simulation::Snapshot& made, const std::string& where,
                                Simulation::Snapshot& snapshot);

}  // namespace fork1s
