#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <fork1s/record/csv.hpp>
#include <fork1s/study/bench.hpp>
#include <fork1s/study/same_steps.hpp>
#include <fstream>
#include <memory>
#include <thread>

#include "bench_scenes.hpp"
#include "checks.hpp"
#include "output.hpp"
#include "progress.hpp"

namespace fork1s::app {
namespace {

constexpr int kInstances = 64;

struct BenchArguments {
  std::vector<std::string> scenes, peers{"mujoco"}, only;
  std::string out, controls, steps_of;
  double time = 1, dt = 0;
  int rounds = 5, truth = 32;
  bool phases = false, json = false;

  bool Wants(const char* part) const {
    return only.empty() || std::find(only.begin(), only.end(), part) != only.end();
  }
  bool HasPeer(const char* peer) const { return std::find(peers.begin(), peers.end(), peer) != peers.end(); }
};

Json Number(double v, bool known = true) { return known && std::isfinite(v) ? Json(v) : Json(nullptr); }

Json PeerJson(const PeerRow& row, const std::optional<double>& instructions) {
  Json out;
  out["step_us"] = Number(row.step_us, row.survived);
  out["ratio"] = Number(row.step_ratio, row.survived);
  out["error_percent"] = Number(row.error_percent, row.survived);
  out["step_instructions"] = Number(instructions.value_or(0), instructions.has_value());
  if (!row.survived) out["end"] = row.end;
  return out;
}

Json SceneJson(const BenchScene& s) {
  const PeerRow& ours = s.rows.front();
  const auto instructions = s.Instructions("fork1s");
  Json out;
  out["dt_s"] = ours.dt_s;
  out["simulated_s"] = ours.time_s;
  out["step_us"] = Number(ours.step_us);
  out["p99_us"] = Number(ours.p99_us);
  out["worst_us"] = Number(ours.worst_us);
  out["refreshes"] = ours.refreshes;
  out["refresh_step_us"] = Number(ours.refresh_step_us, ours.refreshes > 0);
  out["step_instructions"] = Number(instructions.value_or(0), instructions.has_value());
  out["error_percent"] = Number(ours.error_percent);
  out["truth_error_percent"] = Number(s.TruthErrorPercent());
  out["loop_gap_mm"] = Number(ours.loop_gap_mm, ours.has_loops);
  out["peers"] = Json::object();
  for (const PeerRow& row : s.rows)
    if (row.dt_s == ours.dt_s && &row != &ours)
      out["peers"][row.simulator] = PeerJson(row, s.Instructions(row.simulator));
  out["precision"] = Json::array();
  for (const PeerRow& row : s.rows)
    if (row.survived)
      out["precision"].push_back({{"simulator", row.simulator},
                                  {"dt_s", row.dt_s},
                                  {"us_per_simulated_s", row.step_us / row.dt_s},
                                  {"error_percent", Number(row.error_percent)}});
  if (!s.phases.empty()) {
    out["phases"] = Json::object();
    for (const PhaseCost& p : s.phases) out["phases"][p.phase] = p.instructions;
  }
  if (!s.why_no_instructions.empty()) out["why_no_instructions"] = s.why_no_instructions;
  return out;
}

void PrintScene(const BenchScene& s) {
  const PeerRow& ours = s.rows.front();
  fmt::print("{}, {:.3g} s at steps of {:.5g} s; {}\n", s.name, ours.time_s, ours.dt_s,
             std::isfinite(s.TruthErrorPercent())
                 ? fmt::format("the truth is known to {:.2g} % of the motion", s.TruthErrorPercent())
                 : "no interface or free body goes anywhere, so that errors have no percentage");
  fmt::print("  {:<22} {:>10} {:>8} {:>10} {:>10} {:>12} {:>9}\n", "", "us a step", "ratio", "99 % below",
             "worst", "instructions", "error, %");
  for (const PeerRow& r : s.rows) {
    if (r.dt_s != ours.dt_s) continue;
    if (!r.survived) {
      fmt::print("  {:<22} {}\n", r.simulator, r.end);
      continue;
    }
    const auto instructions = s.Instructions(r.simulator);
    fmt::print("  {:<22} {:>10.1f} {:>8.2f} {:>10.1f} {:>10.1f} {:>12} {:>9}\n", r.simulator, r.step_us,
               r.step_ratio, r.p99_us, r.worst_us, instructions ? fmt::format("{:.0f}", *instructions) : "-",
               std::isfinite(r.error_percent) ? fmt::format("{:.3g}", r.error_percent) : "-");
  }
  for (const PhaseCost& p : s.phases)
    fmt::print("    {:<22} {:>12.0f} instructions\n", p.phase, p.instructions);
  std::fflush(stdout);
}

Json PartsJson(const BenchResults& results, Json out) {
  out["recovery"] = Json::array();
  for (const RecoveryCost& r : results.recovery)
    out["recovery"].push_back(
        {{"mode", r.mode},
         {"type", r.type},
         {"interfaces", r.interfaces},
         {"coordinates", r.coordinates},
         {"bodies", r.bodies},
         {"threads", r.threads},
         {"ns_per_body", Number(r.ns_per_body)},
         {"percent_of_ceiling", Number(r.percent_of_ceiling.value_or(0), r.percent_of_ceiling.has_value())},
         {"ceiling", r.bound.empty() ? Json(nullptr) : Json(r.bound)}});
  out["chains"] = Json::array();
  for (const ChainCost& c : results.chains)
    out["chains"].push_back({{"joints", c.joints},
                             {"reduce_ms", c.reduce_ms},
                             {"refresh_ms", c.refresh_ms},
                             {"step_exact_us", c.step_exact_us},
                             {"step_twist_us", c.step_twist_us},
                             {"heap_MB", c.heap_MB}});
  out["many"] = Json::array();
  for (const ManyCost& m : results.many)
    out["many"].push_back(
        {{"scene", m.scene}, {"instances", m.instances}, {"threads", m.threads}, {"step_us", m.step_us}});
  out["stability"] = Json::array();
  for (const BenchStability& s : results.stability)
    for (const StabilityRow& r : s.rows)
      out["stability"].push_back({{"scene", s.scene},
                                  {"simulator", r.simulator},
                                  {"stiffness_scale", r.stiffness_scale},
                                  {"largest_stable_dt_s", r.largest_stable_dt_s}});
  return out;
}

void PrintParts(const BenchResults& results) {
  if (!results.recovery.empty())
    fmt::print("poses of all bodies\n  {:<14} {:>10} {:>8} {:>8} {:>10} {:>26}\n", "", "interfaces", "bodies",
               "threads", "ns a body", "of what the machine can");
  for (const RecoveryCost& r : results.recovery)
    fmt::print("  {:<14} {:>10} {:>8} {:>8} {:>10.1f} {:>26}\n", r.mode, r.interfaces, r.bodies, r.threads,
               r.ns_per_body,
               r.percent_of_ceiling ? fmt::format("{:.0f} %, {}", *r.percent_of_ceiling, r.bound) : "-");
  for (const BenchStability& s : results.stability) {
    fmt::print("largest stable step of {}, stiffness times 1, 10, 100, 1000\n", s.scene);
    for (const StabilityRow& r : s.rows) {
      if (r.stiffness_scale != 1) continue;
      fmt::print("  {:<22}", r.simulator);
      for (const StabilityRow& of_same : s.rows)
        if (of_same.simulator == r.simulator)
          fmt::print(" {:>10}", of_same.largest_stable_dt_s > 0
                                    ? fmt::format("1/{:.0f}", 1 / of_same.largest_stable_dt_s)
                                    : "none");
      fmt::print("\n");
    }
  }
  if (!results.chains.empty())
    fmt::print("chains\n  {:<8} {:>12} {:>14} {:>16} {:>16} {:>8}\n", "joints", "reducing, ms",
               "a refresh, ms", "a step, exact us", "a step, twist us", "MB");
  for (const ChainCost& c : results.chains)
    fmt::print("  {:<8} {:>12.3f} {:>14.3f} {:>16.1f} {:>16.1f} {:>8.2f}\n", c.joints, c.reduce_ms,
               c.refresh_ms, c.step_exact_us, c.step_twist_us, c.heap_MB);
  if (!results.many.empty()) fmt::print("many at a time\n");
  for (const ManyCost& m : results.many)
    fmt::print("  {} of {} on {}: {:.2f} us a step of one\n", m.instances, m.scene,
               m.threads == 1 ? "one thread" : fmt::format("{} threads", m.threads), m.step_us);
}

BenchOptions OptionsFor(const BenchModel& model, const BenchArguments& args) {
  BenchOptions options;
  options.name = model.name;
  options.model_path = model.path;
  options.controls_path = args.controls.empty() ? model.controls : args.controls;
  options.time = args.time;
  options.dt = args.dt;
  options.rounds = args.rounds;
  options.truth_substeps = args.truth;
  options.mujoco = args.HasPeer("mujoco");
  options.phases = args.phases;
  for (const std::string& peer : args.peers)
    if (peer != "mujoco" && peer != "none") options.outside.push_back(FindPeer(peer));
  if (!args.Wants("precision")) options.substeps = {1};
  // Steps as short as the truth's say nothing.
  std::erase_if(options.substeps, [&](int n) { return n > 1 && 4 * n > args.truth; });
  return options;
}

Expected<void> MeasureParts(const std::vector<BenchModel>& models, const BenchArguments& args,
                            BenchResults& results) {
  if (args.Wants("many"))
    for (const BenchModel& model : models) {
      auto many = MeasureMany(OptionsFor(model, args), kInstances);
      if (!many) return tl::unexpected(many.error());
      results.many.insert(results.many.end(), many->begin(), many->end());
    }
  if (args.Wants("stability"))
    for (const BenchModel& model : models) {
      auto stability = MeasureBenchStability(OptionsFor(model, args));
      if (!stability) return tl::unexpected(stability.error());
      results.stability.push_back(std::move(*stability));
    }
  if (args.Wants("recovery")) {
    auto recovery = MeasureRecovery({100, 1000, 10000});
    if (!recovery) return tl::unexpected(recovery.error());
    results.recovery = std::move(*recovery);
  }
  if (args.Wants("chains"))
    for (const int joints : {100, 200, 500, 1000, 2000, 5000}) {
      auto chain = MeasureChain(joints);
      if (!chain) return tl::unexpected(chain.error());
      results.chains.push_back(*chain);
    }
  return {};
}

// "2 x Intel ...".
std::string Machine() {
  std::ifstream info("/proc/cpuinfo");
  std::string name = "unknown processor";
  for (std::string line; std::getline(info, line);)
    if (line.starts_with("model name")) {
      name = line.substr(line.find(':') + 2);
      break;
    }
  return fmt::format("{} x {}", std::thread::hardware_concurrency(), name);
}

// What valgrind runs to count the instructions of its steps: this program with an option that no user needs.
std::vector<std::string> StepCommand(const BenchOptions& options) {
  std::error_code failed;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", failed);
  if (failed) return {};
  std::vector<std::string> command{program.string(), "bench", options.model_path, "--time",
                                   fmt::format("{}", std::min(1.0, options.time))};
  if (options.dt > 0) command.insert(command.end(), {"--dt", fmt::format("{}", options.dt)});
  if (!options.controls_path.empty()) command.insert(command.end(), {"--controls", options.controls_path});
  command.emplace_back("--steps-of");
  return command;
}

// The child of StepCommand.
int TakeSteps(const BenchArguments& args) {
  SameStepsOptions options;
  options.model_path = args.scenes.front();
  options.time = args.time;
  options.dt = args.dt;
  options.integrator =
      args.steps_of == "discrete" ? MuJoCoIntegrator::kDiscrete : MuJoCoIntegrator::kImplicitFast;
  if (!args.controls.empty()) {
    auto controls = ReadControls(args.controls);
    if (!controls) return Report(controls.error(), false);
    options.controls = std::move(*controls);
  }
  const auto steps = StepFromSamePoses(options);
  if (!steps) return Report(steps.error(), false);
  fmt::print("{}\n", steps->steps);
  return kDone;
}

// With names it is a question and not the record, which is whole or not written.
std::string FolderOf(const BenchArguments& args) {
  if (!args.out.empty() || !args.scenes.empty()) return args.out;
  const auto own = std::filesystem::path(OwnScenes()).parent_path() / "benchmarks" / "results";
  return std::filesystem::is_directory(own) ? own.string() : ".";
}

int RunBench(const BenchArguments& args) {
  if (!args.steps_of.empty() && args.scenes.size() == 1) return TakeSteps(args);
  std::vector<BenchModel> models;
  for (const std::string& scene : args.scenes) {
    auto model = FindBenchModel(scene);
    if (!model) return Report(model.error(), args.json);
    models.push_back(std::move(*model));
  }
  if (models.empty()) {
    auto all = AllBenchModels();
    if (!all) return Report(all.error(), args.json);
    models = std::move(*all);
  }
  const std::string out_folder = FolderOf(args);
  if (!out_folder.empty()) {  // before minutes are spent
    std::error_code failed;
    std::filesystem::create_directories(out_folder, failed);
    if (failed)
      return Report({ErrorCode::kFile, out_folder,
                     "no folder can be made there (" + failed.message() + "); give another to --out"},
                    args.json);
  }
  BenchResults results;
  results.when = fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::time(nullptr)));
  results.machine = Machine();
  Json scenes = Json::object();
  int code = kDone;
  if (args.Wants("scenes") || args.Wants("precision"))
    for (const BenchModel& model : models) {
      ProgressBar bar(model.name);
      BenchOptions options = OptionsFor(model, args);
      options.step_command = StepCommand(options);
      options.progress = [&](double share) { bar.Update(share); };
      auto scene = MeasureBench(options);
      if (!scene) {
        if (args.scenes.size() == 1) return Report(scene.error(), args.json);
        code = Report(scene.error(), false);
        scenes[model.name] = {{"error", scene.error().Text()}};
        continue;
      }
      scenes[model.name] = SceneJson(*scene);
      if (!scene->why_no_instructions.empty()) fmt::print(stderr, "note: {}\n", scene->why_no_instructions);
      if (!args.json) PrintScene(*scene);
      results.scenes.push_back(std::move(*scene));
    }
  if (auto parts = MeasureParts(models, args, results); !parts) return Report(parts.error(), args.json);
  if (args.json) {
    Json out;
    out["machine"] = results.machine;
    out["scenes"] = std::move(scenes);
    fmt::print("{}\n", ToText(PartsJson(results, std::move(out)), 2));
  } else {
    PrintParts(results);
  }
  if (out_folder.empty()) return code;
  if (auto written = WriteBench(results, out_folder); !written) return Report(written.error(), false);
  fmt::print(stderr, "written to {}, bench.html shows all of it\n", out_folder);
  return code;
}

}  // namespace

void AddBench(CLI::App& app, Action& action) {
  auto* command =
      app.add_subcommand("bench", "what steps cost and how far off they are, beside other simulators");
  auto args = std::make_shared<BenchArguments>();
  command->add_option(
      "scenes", args->scenes,
      "model files, or names in scenes/, each with SCENE.csv beside it as controls (default: all of "
      "scenes/, and the results are written)");
  command
      ->add_option("--peers", args->peers,
                   "mujoco (default), drake, dart, bullet (plain trees alone, after tools/peers.sh), none")
      ->delimiter(',')
      ->check(CLI::IsMember({"mujoco", "drake", "dart", "bullet", "none"}));
  command
      ->add_option("--only", args->only,
                   "parts to measure: scenes, precision (scenes at shorter steps too), many (64 of each "
                   "scene at a time), "
                   "stability (largest stable step against stiffness), recovery (poses of all bodies), "
                   "chains (by number of joints); default: all")
      ->delimiter(',')
      ->check(CLI::IsMember({"scenes", "precision", "many", "stability", "recovery", "chains"}));
  command->add_option("--time", args->time, "seconds to simulate (default 1)")->check(PositiveUpTo(1e4));
  command->add_option("--dt", args->dt, "time step in s (default: each scene's)")
      ->check(PositiveUpTo(kMostStep));
  command->add_option("--controls", args->controls,
                      "CSV of control values instead of the table beside the model");
  command->add_option("--rounds", args->rounds, "how often each run is repeated, all in turn (default 5)")
      ->check(CLI::Range(1, 1000));
  command
      ->add_option("--truth", args->truth,
                   "steps of the converged full run within one, an even number (default 32)")
      ->check(CLI::Range(2, 4096))
      ->check([](const std::string& n) { return n.back() % 2 == 0 ? "" : "'" + n + "' is not even"; });
  command->add_flag("--phases", args->phases,
                    "instructions of the parts of a step, where valgrind is installed");
  command->add_flag("--json", args->json, "print one JSON object");
  command->add_option("--out", args->out, "folder for tables (CSV), plots (SVG) and the page bench.html");
  command->add_option("--steps-of", args->steps_of)->group("");
  command->callback([&action, args] { action = [args] { return RunBench(*args); }; });
}

}  // namespace fork1s::app
