// Every scene as reduced, full and MuJoCo: benchmarks/results/scene_table.csv and the tables of docs/scenes.
//
//     build/release/benchmarks/scene_table [--out docs/scenes] [SCENE...]
//
// Ten minutes for all on an idle core, 6 s of each scene at most. With names it runs those alone,
// prints their lines and writes nothing. Times vary by machine; ratios come from one process.
#include <fmt/format.h>

#include <fstream>
#include <lab/scene_table.hpp>
#include <string>
#include <vector>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::scene_table {
namespace {

int Report(const fork1s::Error& error) {
  fmt::print(stderr, "{}\n", error.Text());
  return 1;
}

}  // namespace

int Main(int argc, char** argv) {
  const std::string source = FORK1S_SOURCE;
  std::string out = source + "/docs/scenes";
  std::vector<std::string> scenes;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--out" && i + 1 < argc) {
      out = argv[++i];
    } else if (argument.starts_with("-")) {
      fmt::print(stderr, "usage: scene_table [--out FOLDER] [SCENE...]\n");
      return 1;
    } else {
      scenes.push_back(argument);
    }
  }
  const bool all = scenes.empty();
  if (all)
    scenes = {"firemen",     "vehicle",   "excavator",    "hexapod_terrain", "beam_walkers", "hammer",
              "peg_in_hole", "peg_grasp", "grasp_sphere", "grasp_box",       "grasp_mug"};
  std::vector<fork1s::SceneRow> rows;
  for (const std::string& scene : scenes) {
    auto measured =
        fork1s::MeasureScene(source + "/scenes", scene, 6, scene == "peg_grasp" ? "peg_in_hole" : "");
    if (!measured) return Report(measured.error());
    fmt::print("{}",
               fork1s::SceneTableCsv(*measured).substr(rows.empty() ? 0 : fork1s::SceneTableCsv({}).size()));
    std::fflush(stdout);
    if (all) {
      const std::string page = fork1s::ScenePageMarkdown(*measured);
      if (auto written = fork1s::ReplaceTable(out + "/" + scene + ".md", page); !written)
        return Report(written.error());
    }
    rows.insert(rows.end(), measured->begin(), measured->end());
  }
  if (!all) return 0;
  if (auto written = fork1s::ReplaceTable(out + "/README.md", fork1s::SceneTableMarkdown(rows)); !written)
    return Report(written.error());
  std::ofstream csv(source + "/benchmarks/results/scene_table.csv", std::ios::trunc);
  csv << fork1s::SceneTableCsv(rows);
  csv.close();
  if (!csv) {
    fmt::print(stderr, "{}/benchmarks/results/scene_table.csv cannot be written\n", source);
    return 1;
  }
  return 0;
}

}  // namespace fork1s::benchmarks::scene_table
