// Scenes and mechanisms as text, every double to its last bit.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/importer/importer.hpp>
#include <fork1s/mechanism/scene.hpp>
#include <fork1s/sim/simulation.hpp>
#include <memory>
#include <string>
#include <vector>

namespace fork1s {

/// JSON with what is too large for it beside it: shapes name their mesh, height grid or picture by its place
/// here. Shapes that share a mesh share it again after reading.
struct ModelText {
  std::string json;
  std::vector<std::shared_ptr<const TriangleMesh>> meshes;
  std::vector<std::shared_ptr<const HeightGrid>> grids;
  std::vector<std::shared_ptr<const Picture>> pictures = {};
};

/// Finite doubles are written with the digits that give the same bits back, others as "inf", "-inf" and
/// "nan".
ModelText WriteScene(const Scene& scene);
ModelText WriteImportedScene(const ImportedScene& imported);
ModelText WriteMechanism(const MechanismDef& definition);
std::string WriteOptions(const SimulationOptions& options);
std::string WriteImportOptions(const ImportOptions& options);

/// Errors (kFormat): text that is no JSON, or a member that is missing or of the wrong type, named by its
/// path such as "mechanisms[0].bodies[3].inertia.mass". `where` opens the message, such as a file name.
/// Whether the result can be simulated is for BuildMechanism to say.
Expected<Scene> ReadScene(const ModelText& text, const std::string& where);
Expected<ImportedScene> ReadImportedScene(const ModelText& text, const std::string& where);
Expected<MechanismDef> ReadMechanism(const ModelText& text, const std::string& where);
Expected<SimulationOptions> ReadOptions(const std::string& json, const std::string& where);
Expected<ImportOptions> ReadImportOptions(const std::string& json, const std::string& where);

}  // namespace fork1s
