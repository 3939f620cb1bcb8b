#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <fork1s/record/csv.hpp>
#include <fstream>
#include <memory>
#include <thread>

#include "bench_output.hpp"
#include "bench_scenes.hpp"
#include "checks.hpp"
#include "model_arguments.hpp"
#include "print.hpp"
#include "progress.hpp"
#include "study/bench.hpp"
#include "study/same_steps.hpp"

namespace fork1s::app {
namespace {

constexpr int kInstances = 64;

struct BenchArguments {
  std::vector<std::string> scenes, peers{"mujoco"}, only;
  std::string out, controls, steps_of;
  double time = 1, dt = 0;
  int rounds = 5, truth = 32;
  bool phases = false, json = false;

  // Of models that are named their own table alone, unless asked for more; of all scenes everything.
  bool Wants(const std::string& part) const {
    if (only.empty()) return scenes.empty() || part == "scenes";
    return std::find(only.begin(), only.end(), part) != only.end();
  }
  bool HasPeer(const char* peer) const { return std::find(peers.begin(), peers.end(), peer) != peers.end(); }
};

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

// Measurements read the model in this process, beside other simulators: a child reads it first.
template <class Measure>
auto MeasureReadable(const BenchOptions& options, const Measure& measure) -> decltype(measure(options)) {
  ModelArguments model;
  model.path = options.model_path;
  if (const auto read = model.Load(); !read) return tl::unexpected(read.error());
  return measure(options);
}

Expected<void> MeasureParts(const std::vector<BenchModel>& models, const BenchArguments& args,
                            BenchResults& results) {
  if (args.Wants("many"))
    for (const BenchModel& model : models) {
      auto many = MeasureReadable(OptionsFor(model, args),
                                  [](const BenchOptions& o) { return MeasureMany(o, kInstances); });
      if (!many) return tl::unexpected(many.error());
      results.many.insert(results.many.end(), many->begin(), many->end());
    }
  if (args.Wants("stability"))
    for (const BenchModel& model : models) {
      auto stability = MeasureReadable(OptionsFor(model, args), MeasureBenchStability);
      if (!stability) return tl::unexpected(stability.error());
      results.stability.push_back(std::move(*stability));
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
  PrintText("{}\n", steps->steps);
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
      if (options.controls_path.empty())
        PrintText(stderr,
                  "note: {}: no controls: there is no table '{}', and no --controls; its controls stay where "
                  "they start\n",
                  model.name, std::filesystem::path(model.path).replace_extension(".csv").string());
      options.step_command = StepCommand(options);
      options.progress = [&](double share) { bar.Update(share); };
      auto scene = MeasureReadable(options, MeasureBench);
      if (!scene) {
        if (args.scenes.size() == 1) return Report(scene.error(), args.json);
        code = Report(scene.error(), false);
        scenes[model.name] = {{"error", scene.error().Text()}};
        continue;
      }
      scenes[model.name] = SceneJson(*scene, options.controls_path);
      if (!scene->why_no_instructions.empty()) PrintText(stderr, "note: {}\n", scene->why_no_instructions);
      if (!args.json) PrintScene(*scene);
      results.scenes.push_back(std::move(*scene));
    }
  if (auto parts = MeasureParts(models, args, results); !parts) return Report(parts.error(), args.json);
  if (args.json) {
    Json out;
    out["machine"] = results.machine;
    out["scenes"] = std::move(scenes);
    PrintText("{}\n", ToText(PartsJson(results, std::move(out)), 2));
  } else {
    PrintParts(results);
  }
  if (out_folder.empty()) return code;
  if (auto written = WriteBench(results, out_folder); !written) return Report(written.error(), false);
  PrintText(stderr, "written to {}, bench.html shows all of it\n", out_folder);
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
      ->check(OneOf({"mujoco", "drake", "dart", "bullet", "none"}));
  command
      ->add_option(
          "--only", args->only,
          "parts to measure: scenes, precision (scenes at shorter steps too), many (64 of each "
          "scene at a time), "
          "stability (largest stable step against stiffness); default: scenes where a model is named, "
          "else all")
      ->delimiter(',')
      ->check(OneOf({"scenes", "precision", "many", "stability"}));
  command->add_option("--time", args->time, "seconds to simulate (default 1)")
      ->transform(PositiveSecondsUpTo(1e4));
  command->add_option("--dt", args->dt, "time step in s (default: each scene's)")
      ->transform(PositiveSecondsUpTo(kMostStep));
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
                    "times of the parts of a step, and instructions where valgrind is installed");
  command->add_flag("--json", args->json, "print one JSON object");
  command->add_option("--out", args->out, "folder for tables (CSV), plots (SVG) and the page bench.html");
  command->add_option("--steps-of", args->steps_of)->group("");
  command->callback([&action, args] { action = [args] { return RunBench(*args); }; });
}

}  // namespace fork1s::app
