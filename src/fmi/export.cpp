#include "export.hpp"

#include <algorithm>
#include <filesystem>
#include <fork1s/sim/queries.hpp>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include "description.hpp"
#include "zip.hpp"

namespace fork1s::fmi {
namespace {

namespace fs = std::filesystem;

constexpr const char* kProgram = "libfork1s_fmu.so";

// Of the name of a file: letters, digits and underscores, a letter first.
std::string IdentifierOf(const std::string& path) {
  std::string name = fs::path(path).stem().string();
  for (char& c : name)
    if (!((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'))) c = '_';
  if (name.empty() || (name[0] >= '0' && name[0] <= '9')) name.insert(0, "model_");
  return name;
}

Expected<std::vector<int>> FindBodies(const Simulation& simulation, const std::vector<std::string>& names) {
  std::vector<int> bodies;
  for (const std::string& name : names) {
    const auto body = BodyNamed(simulation, name);
    if (!body) return tl::unexpected(body.error());
    if (std::find(bodies.begin(), bodies.end(), *body) == bodies.end()) bodies.push_back(*body);
  }
  if (names.empty())
    for (std::size_t i = 0; i < simulation.bodies().size(); ++i)
      if (const SceneBody& b = simulation.bodies()[i]; b.is_interface || b.mechanism < 0)
        bodies.push_back(static_cast<int>(i));
  return bodies;
}

// Program, libraries and licenses, by their places in the archive.
Expected<std::vector<ZipEntry>> ProgramEntries(const std::string& folder, const std::string& binaries,
                                               const std::string& identifier) {
  std::error_code failed;
  if (!fs::exists(fs::path(folder) / kProgram, failed))
    return Fail(
        ErrorCode::kFile, folder,
        std::string("has no ") + kProgram +
            ", the program of a functional mock-up unit; build the target fork1s_fmu_folder, or install fork1s");
  std::vector<fs::path> paths;
  for (fs::recursive_directory_iterator file(folder, failed), end; !failed && file != end;
       file.increment(failed))
    if (file->is_regular_file(failed)) paths.push_back(file->path());
  if (failed) return Fail(ErrorCode::kFile, folder, "cannot be listed (" + failed.message() + ")");
  std::sort(paths.begin(), paths.end());
  std::vector<ZipEntry> entries;
  for (const fs::path& path : paths) {
    auto bytes = ReadFile(path.string(), "build or install fork1s again");
    if (!bytes) return tl::unexpected(bytes.error());
    const std::string name = path.lexically_relative(folder).generic_string();
    if (name.rfind("licenses/", 0) == 0)
      entries.push_back({"documentation/" + name, std::move(*bytes)});
    else
      entries.push_back({binaries + (name == kProgram ? identifier + ".so" : name), std::move(*bytes), true});
  }
  return entries;
}

}  // namespace

Expected<Exported> WriteUnit(const ImportedScene& imported, const SimulationOptions& simulation_options,
                             const ExportOptions& options, const std::string& out) {
  UnitModel model{imported, simulation_options, {}};
  model.options.initial_keyframe = imported.initial_keyframe;
  auto simulation = Simulation::Create(imported.scene, model.options);
  if (!simulation) return tl::unexpected(simulation.error());
  model.options.dt = simulation->dt();
  auto bodies = FindBodies(*simulation, options.bodies);
  if (!bodies) return tl::unexpected(bodies.error());
  model.bodies = std::move(*bodies);
  const VariableList variables =
      ListVariables(*simulation, MovingJoints(imported.joints, imported.scene), model.bodies);

  const auto resources = WriteResources(model);
  DescriptionText text;
  text.version = options.version;
  text.name = imported.scene.name.empty() ? fs::path(out).stem().string() : imported.scene.name;
  text.identifier = IdentifierOf(out);
  text.token = TokenOf(resources);
  text.tool = options.tool;
  text.dt = simulation->dt();
  std::vector<ZipEntry> entries = {{"modelDescription.xml", WriteDescription(text, variables)}};
  auto program =
      ProgramEntries(options.program, options.version == 2 ? "binaries/linux64/" : "binaries/x86_64-linux/",
                     text.identifier);
  if (!program) return tl::unexpected(program.error());
  std::move(program->begin(), program->end(), std::back_inserter(entries));
  for (const auto& [name, bytes] : resources) entries.push_back({"resources/" + name, bytes});
  if (auto ok = WriteZip(out, entries); !ok) return tl::unexpected(ok.error());

  Exported made;
  made.dt = simulation->dt();
  for (const Variable& v : variables.all) {
    made.inputs += v.causality == Causality::kInput ? 1 : 0;
    made.outputs += v.causality == Causality::kOutput ? 1 : 0;
  }
  made.warnings = simulation->warnings();
  made.warnings.insert(made.warnings.end(), variables.notes.begin(), variables.notes.end());
  return made;
}

}  // namespace fork1s::fmi
