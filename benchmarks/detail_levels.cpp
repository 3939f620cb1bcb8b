// What each level of detail costs and how far it is from the full model, for the grasped ball, and each
// recovery, for scenes with loops: benchmarks/results/detail_levels.csv and the tables of
// docs/scenes/detail.md.
//
//     build/release/benchmarks/detail_levels [--out docs/scenes]
//
// A minute on an idle core. Times vary by machine; all levels of a scene are timed in one process.
#include <fmt/format.h>

#include <fstream>
#include <lab/detail_levels.hpp>
#include <lab/scene_table.hpp>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::detail_levels {
namespace {

int Report(const fork1s::Error& error) {
  fmt::print(stderr, "{}\n", error.Text());
  return 1;
}

constexpr const char* kRecoveries = R"(
## What a recovery costs

Scenes with loops from their start over 2 s, interface and free bodies against the full model at the same step. `curved` closes
loops to second order of what moved since the last refresh, and refreshes where a loop is open by 0.2 mm. `twist` steps as
`exact` does.

)";

}  // namespace

int Main(int argc, char** argv) {
  using fork1s::DetailLevel;
  using fork1s::Recovery;
  const std::string source = FORK1S_SOURCE;
  std::string out = source + "/docs/scenes";
  if (argc == 3 && std::string(argv[1]) == "--out") {
    out = argv[2];
  } else if (argc != 1) {
    fmt::print(stderr, "usage: detail_levels [--out FOLDER]\n");
    return 1;
  }
  const std::vector<fork1s::Fidelity> levels = {
      {DetailLevel::kObject, 0, Recovery::kExact},    {DetailLevel::kObject, -1, Recovery::kExact},
      {DetailLevel::kInterface, 0, Recovery::kExact}, {DetailLevel::kInterface, -1, Recovery::kExact},
      {DetailLevel::kParents, -1, Recovery::kExact},  {DetailLevel::kAll, -1, Recovery::kExact}};
  // The ball hangs in the hand at 3 s and is shaken until 5.5 s.
  auto rows = fork1s::MeasureDetail(source + "/scenes", "grasp_sphere", 3, 5.5, levels);
  if (!rows) return Report(rows.error());
  std::string csv = fork1s::DetailCsv("grasp_sphere", *rows);
  std::vector<std::pair<std::string, std::vector<fork1s::DetailRow>>> scenes;
  for (const char* name : {"firemen", "vehicle", "excavator", "hammer", "peg_in_hole"}) {
    auto measured = fork1s::MeasureDetail(
        source + "/scenes", name, 0, 2,
        {{DetailLevel::kInterface, -1, Recovery::kExact}, {DetailLevel::kInterface, -1, Recovery::kCurved}});
    if (!measured) return Report(measured.error());
    const std::string more = fork1s::DetailCsv(name, *measured);
    csv += more.substr(more.find('\n') + 1);
    scenes.emplace_back(name, std::move(*measured));
  }
  fmt::print("{}", csv);
  const std::string tables = fork1s::DetailMarkdown(*rows) + kRecoveries + fork1s::RecoveryMarkdown(scenes);
  if (auto written = fork1s::ReplaceTable(out + "/detail.md", tables); !written)
    return Report(written.error());
  std::ofstream file(source + "/benchmarks/results/detail_levels.csv", std::ios::trunc);
  file << csv;
  file.close();
  if (!file) {
    fmt::print(stderr, "{}/benchmarks/results/detail_levels.csv cannot be written\n", source);
    return 1;
  }
  return 0;
}

}  // namespace fork1s::benchmarks::detail_levels
