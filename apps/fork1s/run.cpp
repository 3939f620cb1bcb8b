#include <fmt/format.h>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <limits>
#include <memory>
#include <optional>

#include "accuracy_output.hpp"
#include "checks.hpp"
#include "model_arguments.hpp"
#include "print.hpp"
#include "progress.hpp"
#include "run_assumptions.hpp"
#include "run_inputs.hpp"
#include "run_summary.hpp"

namespace fork1s::app {
namespace {

struct RunArguments {
  std::optional<Integrator> integrator;  // as given
  ModelArguments model;
  double time = 2;
  std::optional<std::int64_t> num_steps;  // in place of time
  double dt = 0;
  bool no_load_factor = false;
  bool error = false;
  double refresh_angle = SimulationOptions{}.refresh_angle;  // rad
  InputArguments inputs;
  std::string record, accuracy;
};

// With the detail of the first entry if that begins at once.
Expected<Simulation> Prepare(const RunArguments& args, ImportedScene& imported, const FidelityTrack& detail) {
  SimulationOptions options;
  options.dt = args.dt;
  options.recovery = args.inputs.recovery;
  options.step.integrator = args.integrator.value_or(Integrator::kTwoStage);
  options.step.controls_move = !args.inputs.controls.empty();  // a table's rows are joined by lines
  options.refresh_angle = args.refresh_angle;
  if (!detail.entries.empty() && detail.entries.front().time == 0) {
    const Fidelity& first = detail.entries.front().fidelity;
    options.detail = first.level;
    options.reduction.modes = first.modes;
    options.recovery = first.recovery;
  }
  options.initial_keyframe = imported.initial_keyframe;
  auto simulation = Simulation::Create(imported.scene, options);
  if (!simulation) {
    Error error = simulation.error();
    error.where = args.model.path + (error.where.empty() ? "" : ": " + error.where);
    return tl::unexpected(error);
  }
  return simulation;
}

void AppendPositions(const Simulation& simulation, std::vector<Vector3>& positions) {
  std::vector<RigidTransform> poses;
  simulation.Poses(poses);
  for (const RigidTransform& X : poses) positions.push_back(X.translation());
}

// Errors of a run in parts: where the detail changes the estimate begins at 0 again, and what was off stays off.
void AddPart(const internal::ErrorFigure& figure, internal::ErrorFigure::Largest& sum) {
  const internal::ErrorFigure::Largest part = figure.largest();
  sum.total += part.total;
  sum.interior += part.interior;
  sum.time += part.time;
  sum.motion = std::max(sum.motion, part.motion);
  sum.finite &= part.finite;
}

// What of the setting has an effect at the present detail.
void NoteDetail(const Simulation& simulation, AccuracyTrial& trial) {
  const Fidelity detail = simulation.fidelity();
  trial.exact &= detail.recovery != Recovery::kTwist;
  for (const MechanismDynamics& m : simulation.world().mechanisms()) {
    trial.modes_kept = std::max(trial.modes_kept, m.model().num_modes);
    trial.leaves_something |= detail.modes < 0 && m.model().has_complement;
  }
}

// The run with one setting, for its error alone. `every` [s]: positions are kept at its multiples.
Expected<AccuracyTrial> TryOut(const RunArguments& args, ImportedScene imported, const RunInputs& inputs,
                               const AccuracySetting& setting, double every) {
  const auto start = std::chrono::steady_clock::now();
  RunArguments with = args;
  with.dt = setting.dt;
  with.integrator = setting.integrator;
  with.refresh_angle = setting.refresh_angle;
  if (setting.modes >= 0)
    for (MechanismDef& m : imported.scene.mechanisms) m.modes = setting.modes;
  auto simulation = Prepare(with, imported, inputs.detail);
  if (!simulation) return tl::unexpected(simulation.error());
  const auto steps = CountSteps(args.time, simulation->dt());
  if (!steps) return tl::unexpected(steps.error());
  if (auto ok = CheckInputs(inputs, args.inputs, *simulation); !ok) return tl::unexpected(ok.error());
  inputs.controls.Start(*simulation);
  AccuracyTrial trial;
  trial.setting = setting;
  NoteDetail(*simulation, trial);
  const auto steps_apart = std::max<std::int64_t>(1, std::llround(every / simulation->dt()));
  const std::vector<FidelityTrack::Entry>& detail = inputs.detail.entries;
  std::size_t next_detail = 0;
  std::optional<internal::ErrorFigure> figure(std::in_place);
  ProgressBar bar("trying");
  for (std::int64_t i = 0; i < *steps && trial.finite; ++i) {
    for (; next_detail < detail.size() && IsDue(detail[next_detail], *simulation); ++next_detail) {
      // What is refused stays as it was, here as in the run, which says so.
      if (!simulation->SetFidelity(detail[next_detail].fidelity)) continue;
      AddPart(*figure, trial.error);
      figure.emplace();
      NoteDetail(*simulation, trial);
    }
    const double end = static_cast<double>(i + 1) * simulation->dt();
    inputs.controls.Apply(end, *simulation);
    ApplyPushes(inputs, end, *simulation);
    figure->BeginStep(*simulation);
    const StepReport report = simulation->Step();
    trial.finite = report.finite;
    if (trial.finite) figure->EndStep(*simulation, report);
    if ((i + 1) % steps_apart == 0) AppendPositions(*simulation, trial.positions);
    bar.Update(static_cast<double>(i + 1) / static_cast<double>(*steps));
  }
  AddPart(*figure, trial.error);
  trial.finite &= trial.error.finite;
  trial.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return trial;
}

int Run(const RunArguments& given) {
  RunArguments args = given;
  const bool json = args.model.json;
  if (auto ok = RefuseInputs(args.record, {args.model.path, args.inputs.controls}); !ok)
    return Report(ok.error(), json);
  auto imported = args.model.Load();
  if (!imported) return Report(imported.error(), json);
  if (!json) PrintNotes(imported->report);
  const auto inputs = ReadInputs(args.inputs);
  if (!inputs) return Report(inputs.error(), json);
  std::optional<AccuracyChoice> choice;
  if (!args.accuracy.empty()) {
    const auto wanted = ParseAccuracy(args.accuracy);
    if (!wanted) return Report(wanted.error(), json);
    const auto probe = Prepare(args, *imported, inputs->detail);
    if (!probe) return Report(probe.error(), json);
    const AccuracySetting first{probe->dt(), probe->step_options().integrator, -1, args.refresh_angle};
    auto made = ChooseForAccuracy(*wanted, first, !args.integrator, [&](const AccuracySetting& setting) {
      return TryOut(args, *imported, *inputs, setting, first.dt);
    });
    if (!made) return Report(made.error(), json);
    choice = std::move(*made);
    const AccuracySetting& best = choice->trials[choice->chosen].setting;
    args.dt = best.dt;
    args.integrator = best.integrator;
    args.refresh_angle = best.refresh_angle;
    args.error = true;
    if (best.modes >= 0)
      for (MechanismDef& m : imported->scene.mechanisms) m.modes = best.modes;
  }
  auto simulation = Prepare(args, *imported, inputs->detail);
  if (!simulation) return Report(simulation.error(), json);
  const auto steps =
      args.num_steps ? Expected<std::int64_t>(*args.num_steps) : CountSteps(args.time, simulation->dt());
  if (!steps) return Report(steps.error(), json);

  if (auto ok = CheckInputs(*inputs, args.inputs, *simulation); !ok) return Report(ok.error(), json);
  inputs->controls.Start(*simulation);
  const double end = static_cast<double>(*steps) * simulation->dt();
  std::vector<std::string> limits = InputLimits(*inputs, args.inputs, *simulation, end);
  constexpr double kNoticed = 0.01;  // of the time asked for
  if (!args.num_steps && std::abs(end - args.time) > kNoticed * args.time)
    limits.push_back(
        fmt::format("--time {:.6g} s is no whole number of steps of {:.6g} s: {:.6g} s are simulated",
                    args.time, simulation->dt(), end));
  for (const std::string& sentence : limits) PrintText(stderr, "warning: {}\n", sentence);
  std::optional<Recorder> recorder;
  Expected<void> recorded;
  if (!args.record.empty()) {
    auto created = Recorder::Create(args.record, *simulation);
    if (!created) return Report(created.error(), json);
    recorder.emplace(std::move(*created));
  }
  const Json assumed = AssumptionsJson(*simulation, args.inputs, args.model);
  if (!json) PrintAssumptions(assumed);
  std::fflush(stdout);  // before what may take minutes
  const Measured measured =
      Simulate(*simulation, *inputs, *steps,
               {!args.no_load_factor, args.error, imported->report.velocity_limits}, recorder, recorded);
  if (recorder && recorded) recorded = recorder->Finish();

  Json summary = Summary(*simulation, measured);
  summary["assumed"] = assumed;
  if (json)  // else they stand above
    for (const std::string& sentence : limits) summary["warnings"].push_back(sentence);
  summary["notes"] = NotesJson(imported->report);
  if (choice) {
    summary["accuracy"] = AccuracyJson(args.accuracy, *choice);
    if (!choice->met())
      summary["warnings"].push_back(
          fmt::format("--accuracy {} was not met by any of {} settings that were tried", args.accuracy,
                      choice->trials.size()));
  }
  if (json)
    PrintText("{}\n", ToText(summary, 2));
  else
    PrintSummary(summary);
  if (!recorded) return Report(recorded.error(), false);
  if (!args.record.empty()) PrintText(stderr, "recorded to {}\n", args.record);
  if (!measured.impossible.empty())
    return Report(
        {ErrorCode::kNumerics, args.model.path,
         measured.impossible + ": the motion has blown up. Try a smaller --dt, another --integrator, more "
                               "--modes, or controls that move more slowly"},
        false);
  if (measured.failed_step >= 0 && measured.failed_unsolved)
    return Report(
        {ErrorCode::kNumerics, args.model.path,
         fmt::format(
             "step {} was undone: {} could not be solved even in parts of 1/64 of the step. Try a smaller --dt, "
             "or softer gains, pushes and springs",
             measured.failed_step, measured.failed_of.empty() ? "the motion" : measured.failed_of)},
        false);
  if (measured.failed_step >= 0)
    return Report(
        {ErrorCode::kNumerics, args.model.path,
         fmt::format("step {} gave numbers that are not finite; the state before it was kept. Try a smaller "
                     "--dt, and look for joints that nothing holds with 'fork1s inspect'",
                     measured.failed_step)},
        false);
  return kDone;
}

}  // namespace

void AddRun(CLI::App& app, Action& action) {
  auto* command = app.add_subcommand("run", "simulate a model in contact");
  auto args = std::make_shared<RunArguments>();
  args->model.AddTo(*command);
  auto* time = command->add_option("--time", args->time, "seconds to simulate (default 2)")
                   ->transform(SecondsWithin(0, kMostSeconds));
  auto* steps = command->add_option("--steps", args->num_steps, "steps to simulate, instead of --time")
                    ->check(CLI::Range(0, std::numeric_limits<int>::max()))
                    ->excludes(time);
  command->add_option("--dt", args->dt, "time step in s (default 1/60)")
      ->transform(PositiveSecondsUpTo(kMostStep));
  command->add_option("--controls", args->inputs.controls,
                      "CSV of control values and pushes: time,NAME,...,force:BODY:x,...");
  AddPushTo(*command, args->inputs.pushes);
  AddIntegratorTo(*command, args->integrator);
  AddRecoveryTo(*command, args->inputs.recovery);
  command->add_option(
      "--detail", args->inputs.detail,
      "how much is simulated, from what time on: [TIME:]WORD[+WORD...],... with object, "
      "interface, parents, all, modes=K, exact, expanded, curved, twist; as in interface,2:object");
  command->add_option("--record", args->record, "write a recording to this HDF5 file");
  command
      ->add_option(
          "--accuracy", args->accuracy,
          "how far off the run may be, as in 0.5mm or 1% of the motion: tries it with other dt, "
          "integrator, modes and refresh angles until its estimated error is below that, and says what "
          "it chose")
      ->excludes(steps);
  command->add_flag(
      "--error", args->error,
      "estimate how far the run is from the truth, the time step and what the reduction leaves out, by "
      "simulations of a quarter of the step beside it");
  command->add_flag("--no-load-factor", args->no_load_factor,
                    "do not watch how much harder a grasp may press before it ejects what it holds");
  command->callback([&action, args] { action = [args] { return Run(*args); }; });
}

}  // namespace fork1s::app
