// fork1s and MuJoCo's integrators at 1/60 s, each against the converged full model:
// benchmarks/results/peer_table.csv and the table of docs/peers.md.
//
//     build/release/benchmarks/peer_table [--out docs/peers.md] [SCENE...]
//
// Minutes for all, most of them for the converged runs. With names it runs those alone, prints their lines
// and writes nothing. Times vary by machine; ratios come from one process, all simulators in turn.
#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fork1s/record/csv.hpp>
#include <fstream>
#include <hand_scenario.hpp>
#include <lab/peer_table.hpp>
#include <lab/scene_table.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::peer_table {
namespace {

struct Case {
  const char* scene;  // as the table calls it
  const char* model;  // of scenes/, and its table of controls
  const char* keyframe;
  double time;         // s: as long as halving the finest step changes less than what is compared
  int truth_substeps;  // of 1/60 s, of second order: twice its step is off by a percent of the motion or less
};

// Up to these times the way that bodies take hangs on the model, not on which stone or tile is met first.
constexpr Case kCases[] = {{"firemen", "firemen", "", 1, 4},     {"vehicle", "vehicle", "", 2, 8},
                           {"hand", "hand", "open", 10.7, 8},    {"hexapod", "hexapod_terrain", "", 2, 8},
                           {"excavator", "excavator", "", 3, 4}, {"beam_walkers", "beam_walkers", "", 4, 4}};

int Report(const Error& error) {
  fmt::print(stderr, "{}\n", error.Text());
  return 1;
}

// A mocap body's children are carried without velocity in MuJoCo, so that friction lets slip what they hold.
// Its users weld a free body to the mocap body instead: this file with the palm moved so. "palm" stays the
// name of what is driven.
Expected<std::string> WithWeldedPalm(const std::string& model, const std::string& target) {
  std::stringstream read;
  read << std::ifstream(model).rdbuf();
  std::string text = read.str();
  const std::pair<std::string, std::string> changes[] = {
      {"<body name=\"palm\" mocap=\"true\" pos=\"0 0 0.116\">",
       "<body name=\"palm\" mocap=\"true\" pos=\"0 0 0.116\"/>\n<body name=\"palm_body\" pos=\"0 0 "
       "0.116\"><freejoint/>"},
      {"<keyframe>",
       "<equality><weld body1=\"palm\" body2=\"palm_body\" solref=\"0.002 1\"/></equality>\n<keyframe>"},
      {"<key name=\"open\" qpos=\"", "<key name=\"open\" qpos=\"0 0 0.116 1 0 0 0 "}};
  for (const auto& [from, to] : changes) {
    const auto at = text.find(from);
    if (at == std::string::npos) return Fail(ErrorCode::kFormat, model, "has no " + from);
    text.replace(at, from.size(), to);
  }
  std::ofstream(target) << text;
  return target;
}

// The set-points of ./demo.
Expected<ControlTrack> GraspControls(const std::string& model) {
  const auto table = std::filesystem::temp_directory_path() / fmt::format("fork1s_grasp_{}.csv", getpid());
  examples::HandScenario scenario;
  scenario.controls_csv = table.string();
  auto done = examples::RunHandScenario(model, scenario);
  if (!done) return tl::unexpected(done.error());
  auto read = ReadControls(table.string());
  std::filesystem::remove(table);
  return read;
}

}  // namespace

int Main(int argc, char** argv) {
  // MuJoCo steps on one thread, so that we do as well.
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  const std::string source = FORK1S_SOURCE;
  std::string out = source + "/docs/peers.md";
  std::vector<std::string> wanted;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--out" && i + 1 < argc) {
      out = argv[++i];
    } else if (argument.starts_with("-")) {
      fmt::print(stderr, "usage: peer_table [--out FILE] [SCENE...]\n");
      return 1;
    } else {
      wanted.push_back(argument);
    }
  }
  std::vector<PeerRow> rows;
  for (const Case& c : kCases) {
    if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), c.scene) == wanted.end()) continue;
    PeerOptions options;
    options.scene = c.scene;
    options.model_path = source + "/scenes/" + c.model + ".xml";
    options.keyframe = c.keyframe;
    options.time = c.time;
    options.truth_substeps = c.truth_substeps;
    options.entrants = PeerTableEntrants();
    const std::string table = source + "/scenes/" + c.model + ".csv";
    if (std::string(c.scene) == "hand" || std::filesystem::exists(table)) {
      auto controls =
          std::string(c.scene) == "hand" ? GraspControls(options.model_path) : ReadControls(table);
      if (!controls) return Report(controls.error());
      options.controls = std::move(*controls);
    }
    if (std::string(c.scene) == "hand") {
      const auto target =
          std::filesystem::temp_directory_path() / fmt::format("fork1s_welded_palm_{}.xml", getpid());
      auto welded = WithWeldedPalm(options.model_path, target.string());
      if (!welded) return Report(welded.error());
      options.mujoco_path = *welded;
    }
    auto measured = MeasurePeers(options);
    if (!options.mujoco_path.empty()) std::filesystem::remove(options.mujoco_path);
    if (!measured) return Report(measured.error());
    fmt::print("{}", PeerTableCsv(*measured).substr(rows.empty() ? 0 : PeerTableCsv({}).size()));
    std::fflush(stdout);
    rows.insert(rows.end(), measured->begin(), measured->end());
  }
  if (!wanted.empty()) return 0;
  if (auto written = ReplaceTable(out, PeerTableMarkdown(rows)); !written) return Report(written.error());
  std::ofstream csv(source + "/benchmarks/results/peer_table.csv", std::ios::trunc);
  csv << PeerTableCsv(rows);
  csv.close();
  if (!csv) {
    fmt::print(stderr, "{}/benchmarks/results/peer_table.csv cannot be written\n", source);
    return 1;
  }
  return 0;
}

}  // namespace fork1s::benchmarks::peer_table
