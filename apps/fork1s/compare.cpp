#include <fmt/format.h>
#include <cmath>
#include <fork1s/study/compare.hpp>
#include <map>
#include <memory>
#include <optional>
#include <tuple>

#include "checks.hpp"
#include "model_arguments.hpp"
#include "output.hpp"
#include "print.hpp"
#include "progress.hpp"
#include "run_inputs.hpp"

namespace fork1s::app {
namespace {

struct CompareArguments {
  std::optional<Integrator> step_integrator;  // as given
  std::optional<FullIntegrator> full_integrator;
  ModelArguments model;
  std::string against = "full", report;
  InputArguments inputs;
  MuJoCoIntegrator integrator = MuJoCoIntegrator::kOfFile;
  double time = 2, dt = 0;
  int refinements = 2;
};

Json ComparisonJson(const std::vector<BodyDifference>& bodies) {
  Json out = Json::array();
  for (const BodyDifference& b : bodies)
    out.push_back({{"body", b.body},
                   {"rms_mm", b.rms_mm},
                   {"max_mm", b.max_mm},
                   {"rms_deg", b.rms_deg},
                   {"max_deg", b.max_deg}});
  return out;
}

Json ComparisonJson(const EnergyDrift& e) {
  return {{"first", e.first_J}, {"last", e.last_J}, {"max_increase", e.max_rise_J}};
}

Json PairsJson(const std::vector<ContactPair>& pairs, bool recorded) {
  Json out = Json::array();
  for (const ContactPair& p : pairs) {
    out.push_back({{"bodies", {p.body_a, p.body_b}}});
    if (recorded) out.back()["touched"] = p.touched;
  }
  return out;
}

Json ComparisonJson(const Comparison& c) {
  Json out;
  out["against"] = c.other;
  out["integrator"] = {{"reduced", NameOf(c.integrator)}};
  if (c.full_integrator) out["integrator"]["full"] = NameOf(*c.full_integrator);
  out["simulated_s"] = c.time_s;
  out["dt_s"] = c.dt_s;
  out["other_dt_s"] = c.other_dt_s;
  out["interface"] = ComparisonJson(c.interface);
  out["free_bodies"] = ComparisonJson(c.free_bodies);
  if (c.other == "mujoco")
    out["contact_pairs"] = {{"mujoco_only", PairsJson(c.pairs_only_other, true)},
                            {"reduced_only", PairsJson(c.pairs_only_reduced, false)}};
  if (c.other == "mujoco") out["laws"] = c.laws;
  if (c.other == "mujoco") out["dropped"] = c.dropped;
  out["force_rms_N"] = c.force_rms_N;
  out["force_max_N"] = c.force_max_N;
  out["force_rms_percent"] = c.force_rms_percent;
  out["frequencies_hz"] = {{"reduced", c.frequencies_reduced_hz}, {"full", c.frequencies_full_hz}};
  out["gap_max_mm"] = c.gap_max_mm;
  out["gap_max_other_mm"] = c.gap_max_other_mm;
  out["energy_J"] = {{"reduced", ComparisonJson(c.energy_reduced)},
                     {"other", ComparisonJson(c.energy_other)}};
  out["wall_s"] = {{"reduced", c.wall_reduced_s}, {"other", c.wall_other_s}};
  out["wall_ratio"] = c.wall_ratio;
  out["equal_dt"] = Json::array();
  for (const EqualStep& e : c.equal_steps)
    out["equal_dt"].push_back({{"dt_s", e.dt_s},
                               {"rms_mm", e.rms_mm},
                               {"max_mm", e.max_mm},
                               {"wall_reduced_s", e.wall_reduced_s},
                               {"wall_other_s", e.wall_other_s}});
  out["cost"] = Json::array();
  for (const CostPoint& p : c.costs)
    out["cost"].push_back({{"simulator", p.simulator},
                           {"dt_s", p.dt_s},
                           {"wall_s", p.wall_s},
                           {"rms_mm", p.rms_mm},
                           {"max_mm", p.max_mm}});
  out["unconverged_steps"] = {{"reduced", c.unconverged_reduced}, {"other", c.unconverged_other}};
  if (c.full_integrator) out["halved_steps"] = c.halved_other;
  out["warnings"] = c.warnings;
  return out;
}

void PrintFrequencies(const char* label, const std::vector<double>& hertz) {
  PrintText("  {:<18}", label);
  for (double f : hertz) PrintText(" {:.5g}", f);
  PrintText(" Hz\n");
}

void Print(const Comparison& c) {
  PrintText("reduced against {}: {:.4g} s at steps of {:.6g} s", c.other, c.time_s, c.dt_s);
  if (c.other_dt_s != c.dt_s) PrintText(", {} at {:.6g} s", c.other, c.other_dt_s);
  PrintText("; {}", IntegratorsText(c));
  const std::vector<std::string> differences = DifferenceLines(c);
  if (!differences.empty()) PrintText("\nwhat the two do differently, before any number:");
  for (const std::string& line : differences) PrintText("\n  {}", line);
  PrintText("\n  {:<24} {:>10} {:>10} {:>10} {:>10}\n", "", "RMS mm", "max mm", "RMS deg", "max deg");
  for (const auto* list : {&c.interface, &c.free_bodies})
    for (const BodyDifference& b : *list)
      PrintText("  {:<24} {:>10.4f} {:>10.4f} {:>10.4f} {:>10.4f}\n", b.body, b.rms_mm, b.max_mm, b.rms_deg,
                b.max_deg);
  PrintText("  contact force      {:.4g} N RMS apart, {}\n", c.force_rms_N,
            std::isnan(c.force_rms_percent) ? fmt::format("none in {}", c.other)
                                            : fmt::format("{:.3g} % of {}'s", c.force_rms_percent, c.other));
  PrintFrequencies("reduced", c.frequencies_reduced_hz);
  PrintFrequencies("full", c.frequencies_full_hz);
  PrintText("  joint gap          {:.3g} mm at most ({}: {:.3g} mm)\n", c.gap_max_mm, c.other,
            c.gap_max_other_mm);
  PrintText("  energy             {:.6g} J to {:.6g} J ({}: {:.6g} J to {:.6g} J)\n",
            c.energy_reduced.first_J, c.energy_reduced.last_J, c.other, c.energy_other.first_J,
            c.energy_other.last_J);
  PrintText("  wall time          {:.4g} s, {} {:.4g} s: {:.1f} times\n", c.wall_reduced_s, c.other,
            c.wall_other_s, c.wall_ratio);
  PrintText("  not converged      {} steps, {} {} steps\n", c.unconverged_reduced, c.other,
            c.unconverged_other);
  if (c.full_integrator == FullIntegrator::kTwoStages)
    PrintText("  halved             {} {} steps, in which something was met\n", c.halved_other, c.other);
  if (!c.equal_steps.empty()) PrintText("at equal steps\n");
  for (const EqualStep& e : c.equal_steps)
    PrintText("  dt {:>10.6f} s      {:>10.4f} mm RMS {:>10.4f} mm max\n", e.dt_s, e.rms_mm, e.max_mm);
  PrintText("against {} at its finest step\n", c.other);
  for (const CostPoint& p : c.costs)
    PrintText("  {:<8} dt {:>10.6f} s {:>10.4f} mm RMS {:>10.4f} mm max in {:.4g} s\n", p.simulator, p.dt_s,
              p.rms_mm, p.max_mm, p.wall_s);
  for (const std::string& w : c.warnings) PrintText("  warning: {}\n", w);
}

// The inputs as both sides take them, and sentences on what neither takes as it stands.
Expected<std::vector<std::string>> ReadComparedInputs(const CompareArguments& args,
                                                      const ImportedScene& imported,
                                                      CompareOptions& options) {
  auto inputs = ReadInputs(args.inputs);
  if (!inputs) return tl::unexpected(inputs.error());
  std::vector<std::string> limits;
  SimulationOptions probed;
  probed.dt = args.dt;
  probed.initial_keyframe = imported.initial_keyframe;
  // What no simulation can be made of is refused by the comparison itself, with its reason.
  if (const auto probe = Simulation::Create(imported.scene, probed)) {
    if (auto ok = CheckInputs(*inputs, args.inputs, *probe); !ok) return tl::unexpected(ok.error());
    limits = InputLimits(*inputs, args.inputs, *probe, args.time);
  }
  options.controls = std::move(inputs->controls);
  options.detail = std::move(inputs->detail);
  for (PushTrack& track : inputs->pushes)
    for (Push& push : track.pushes) options.pushes.pushes.push_back(std::move(push));
  return limits;
}

int Run(const CompareArguments& args) {
  const bool json = args.model.json;
  if (auto ok = RefuseInputs(args.report, {args.model.path, args.inputs.controls}); !ok)
    return Report(ok.error(), json);
  auto imported = args.model.Load();
  if (!imported) return Report(imported.error(), json);
  if (!json) PrintNotes(imported->report);
  const bool mujoco = args.against == "mujoco";
  const Json notes = NotesJson(imported->report);
  Expected<SharedModel> model = mujoco ? args.model.ShareWithMuJoCo(std::move(*imported))
                                       : SharedModel{args.model.path, std::move(*imported), nullptr};
  if (!model) return Report(model.error(), json);
  CompareOptions options;
  options.against = mujoco ? Against::kMuJoCo : Against::kFull;
  options.time = args.time;
  options.dt = args.dt;
  options.recovery = args.inputs.recovery;
  options.integrator = args.step_integrator.value_or(Integrator::kTwoStage);
  options.full_integrator = args.full_integrator;
  options.refinements = args.refinements;
  options.mujoco_integrator = args.integrator;
  options.model_path = model->path;
  options.model_name = args.model.path;
  const auto limits = ReadComparedInputs(args, model->imported, options);
  if (!limits) return Report(limits.error(), json);
  Expected<Comparison> comparison = [&] {
    ProgressBar bar("comparing");
    options.progress = [&](double share) { bar.Update(share); };
    return Compare(model->imported, options);
  }();
  if (!comparison) {
    Error error = comparison.error();
    if (error.where != args.model.path)
      error.where = args.model.path + (error.where.empty() ? "" : ": " + error.where);
    return Report(error, json);
  }
  comparison->warnings.insert(comparison->warnings.end(), limits->begin(), limits->end());
  if (json) {
    Json out = ComparisonJson(*comparison);
    out["notes"] = notes;
    PrintText("{}\n", ToText(out, 2));
  } else {
    Print(*comparison);
  }
  if (args.report.empty()) return kDone;
  if (auto written = WriteComparisonReport(*comparison, args.report); !written)
    return Report(written.error(), false);
  PrintText(stderr, "report written to {}\n", args.report);
  return kDone;
}

}  // namespace

void AddCompare(CLI::App& app, Action& action) {
  auto* command =
      app.add_subcommand("compare", "simulate a model beside the full-coordinate simulator or MuJoCo");
  auto args = std::make_shared<CompareArguments>();
  args->model.AddTo(*command);
  command
      ->add_option(
          "--against", args->against,
          "full (default) or mujoco, which opens the file; a URDF, or a model with --base, --pd, --q, "
          "--base-pose or --ground, as 'fork1s export' writes it")
      ->check(OneOf({"full", "mujoco"}));
  static const std::map<std::string, MuJoCoIntegrator> integrators = {
      {"Euler", MuJoCoIntegrator::kEuler},
      {"implicitfast", MuJoCoIntegrator::kImplicitFast},
      {"discrete", MuJoCoIntegrator::kDiscrete}};
  command
      ->add_option("--mujoco-integrator", args->integrator,
                   "with --against mujoco: Euler, implicitfast or discrete (default: the file's)")
      ->transform(OneOf(integrators));
  command->add_option("--time", args->time, "seconds to simulate (default 2)")
      ->transform(PositiveSecondsUpTo(1e5));
  command->add_option("--dt", args->dt, "time step in s (default: the file's)")
      ->transform(PositiveSecondsUpTo(kMostStep));
  command->add_option("--controls", args->inputs.controls,
                      "CSV of control values and pushes: time,NAME,...,force:BODY:x,...");
  AddPushTo(*command, args->inputs.pushes);
  command->add_option("--detail", args->inputs.detail,
                      "level of detail of the reduced run, as of 'fork1s run'");
  AddIntegratorTo(*command, args->step_integrator);
  static const std::map<std::string, FullIntegrator> full_integrators = {
      {"euler", FullIntegrator::kEuler}, {"two-stages", FullIntegrator::kTwoStages}};
  command
      ->add_option("--full-integrator", args->full_integrator,
                   "of the full run: euler, or two-stages, of second order; default: of the same order as "
                   "the reduced run's")
      ->transform(OneOf(full_integrators));
  AddRecoveryTo(*command, args->inputs.recovery);
  command->add_option("--refinements", args->refinements, "further runs at dt/2, dt/4, ... (default 2)")
      ->check(CLI::Range(0, 8));
  command->add_option("--report", args->report, "write an HTML page with plots to this file");
  command->callback([&action, args] { action = [args] { return Run(*args); }; });
}

}  // namespace fork1s::app
