#include "bench_scenes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

namespace fork1s::app {
namespace {

namespace fs = std::filesystem;

BenchModel ModelAt(const fs::path& path) {
  BenchModel model{path.stem().string(), path.string(), {}};
  fs::path table = path;
  table.replace_extension(".csv");
  std::error_code ignored;
  if (fs::is_regular_file(table, ignored)) model.controls = table.string();
  return model;
}

std::vector<fs::path> SceneFolders() {
  std::vector<fs::path> folders{"scenes"};
  if (const std::string own = OwnScenes(); !own.empty()) folders.emplace_back(own);
  return folders;
}

}  // namespace

// Of a build folder in the sources, build/NAME/bin/fork1s; of the Python package, fork1s/bin/fork1s.
std::string OwnScenes() {
  std::error_code failed;
  const fs::path program = fs::read_symlink("/proc/self/exe", failed);
  if (failed) return {};
  for (const char* way : {"../../../scenes", "../scenes"}) {
    const fs::path folder = (program.parent_path() / way).lexically_normal();
    if (fs::is_directory(folder, failed)) return folder.string();
  }
  return {};
}

Expected<BenchModel> FindBenchModel(const std::string& scene) {
  std::error_code ignored;
  if (fs::is_regular_file(scene, ignored)) return ModelAt(scene);
  for (const fs::path& folder : SceneFolders())
    if (const fs::path path = folder / (scene + ".xml"); fs::is_regular_file(path, ignored))
      return ModelAt(path);
  return Fail(ErrorCode::kFile, scene,
              "is no file and no scene; name a model file, or one of scenes/ without its ending");
}

Expected<std::vector<BenchModel>> AllBenchModels() {
  std::vector<BenchModel> models;
  for (const fs::path& folder : SceneFolders()) {
    std::error_code failed;
    for (const auto& entry : fs::directory_iterator(folder, failed))
      if (entry.path().extension() == ".xml") models.push_back(ModelAt(entry.path()));
    if (!models.empty()) break;
  }
  std::sort(models.begin(), models.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  if (models.empty())
    return Fail(ErrorCode::kFile, "scenes",
                "no scenes lie in this folder or beside the program; name a model file");
  return models;
}

OutsidePeer FindPeer(const std::string& peer) {
  OutsidePeer out;
  out.name = peer == "drake" ? "Drake SAP" : peer == "dart" ? "DART" : "Bullet";
  const fs::path sources = fs::path(OwnScenes()).parent_path(),
                 program = sources / "benchmarks/peers" / (peer + ".py"),
                 python = sources / "build/peers/bin/python";
  std::error_code ignored;
  if (!fs::exists(program, ignored))
    out.why_not = "is run from the sources of fork1s, and this program was installed without them";
  else if (!fs::exists(python, ignored))
    out.why_not = "is not installed; tools/peers.sh does that";
  out.command = {python.string(), program.string()};
  return out;
}

}  // namespace fork1s::app
