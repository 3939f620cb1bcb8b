#include <fmt/format.h>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <fork1s/dynamics/load_factor.hpp>
#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/record/csv.hpp>
#include <fork1s/record/recording.hpp>
#include <fork1s/sim/passing.hpp>
#include <fork1s/sim/simulation.hpp>
#include <memory>
#include <optional>

#include "accuracy_choice.hpp"
#include "checks.hpp"
#include "error_watch.hpp"
#include "model_arguments.hpp"
#include "output.hpp"
#include "progress.hpp"

namespace fork1s::app {
namespace {

struct RunArguments {
  Integrator step_integrator = Integrator::kEuler;
  ModelArguments model;
  double time = 2;
  double dt = 0;
  bool no_load_factor = false;
  bool error = false;
  double refresh_angle = SimulationOptions{}.refresh_angle;  // rad
  bool integrator_given = false;
  std::string controls, recovery = "exact", record, detail, accuracy;
};

// What a run measures, step by step.
struct Measured {
  std::vector<double> step_us;
  int contacts_max = 0, unconverged = 0, refreshes = 0, failed_refreshes = 0;
  double energy_first = 0, energy_last = 0, energy_increase = 0;
  double gap_max = 0, penetration_max = 0;
  int steps_at_bound = 0, most_at_bound = 0;  // servos and motors that gave all they can
  bool contacts_dropped = false;
  std::int64_t failed_step = -1;
  std::string impossible;  // what a step ended with that no mechanism does; empty: nothing
  LoadFactor load_min;  // of what was still there at the next look
  double load_min_time = 0;
  struct Switch {
    double time = 0;  // s
    Fidelity fidelity;
    double ms = 0;
    std::string refused;  // why not; empty: done
  };
  std::vector<Switch> switches;
  std::optional<ErrorWatch> error;
  std::vector<Passing> passed;  // bodies that touch nothing, and went into something
  bool held = false;        // contacts were frozen in some step
  double hold_use_max = 0;  // see HoldForce
};

// Changes the level of detail when its time has come.
void Switch(const FidelityTrack& track, std::size_t& next, Simulation& simulation, Measured& out) {
  for (; next < track.entries.size() && track.entries[next].time <= simulation.time() + 1e-9; ++next) {
    Measured::Switch done{simulation.time(), track.entries[next].fidelity, 0, ""};
    const auto start = std::chrono::steady_clock::now();
    if (auto set = simulation.SetFidelity(done.fidelity); !set)
      done.refused = set.error().Text();
    else if (out.error)
      out.error->Forget();
    done.ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    out.switches.push_back(std::move(done));
  }
}

void WatchHolds(const Simulation& simulation, Measured& out) {
  for (const HoldForce& f : simulation.HoldForces()) {
    out.held = true;
    out.hold_use_max = std::max(out.hold_use_max, f.use);
  }
}

// Watches bodies that are no interface; anew where the detail changed.
class Passers {
 public:
  explicit Passers(const Simulation& simulation) { Watch(simulation); }
  void Look(const Simulation& simulation, std::size_t switches, Measured& out) {
    if (switches != switches_) {
      Keep(out);
      Watch(simulation);
      switches_ = switches;
    }
    if (watch_) watch_->Look(simulation);
  }
  void Keep(Measured& out) const {
    if (!watch_) return;
    for (Passing& p : watch_->Found()) out.passed.push_back(std::move(p));
  }

 private:
  void Watch(const Simulation& simulation) {
    auto watch = PassingWatch::Create(simulation);
    if (watch)
      watch_.emplace(std::move(*watch));
    else
      watch_.reset();
  }
  std::optional<PassingWatch> watch_;
  std::size_t switches_ = 0;
};

// Looks at the grasp now and then: it costs more than a step.
class LoadWatch {
 public:
  void Look(const Simulation& simulation, Measured& out) {
    if (simulation.steps() % 10 != 0) return;
    const LoadFactor now = ComputeLoadFactor(simulation.world(), simulation.present_scene(), simulation.dt());
    // An impact loads a contact for a single step: of two looks in a row the gentler one counts.
    const LoadFactor& held = now.factor > before_.factor ? now : before_;
    if (held.factor < out.load_min.factor) {
      out.load_min = held;
      out.load_min_time = simulation.time();
    }
    before_ = now;
  }

 private:
  LoadFactor before_;
};

// Numbers that are finite, or were a step ago, and mean nothing.
std::string Impossible(const Simulation& simulation, double energy) {
  std::string body;
  double fastest = 0;
  for (std::size_t b = 0; b < simulation.bodies().size(); ++b) {
    if (simulation.bodies()[b].mechanism >= 0 && !simulation.bodies()[b].is_interface) continue;
    const double speed = simulation.Velocity(static_cast<int>(b)).tail<3>().norm();
    if (speed <= fastest) continue;
    fastest = speed;
    body = simulation.bodies()[b].name;
  }
  constexpr double kLight = 299792458;  // m/s
  if (std::isfinite(energy) && fastest < kLight) return "";
  return fmt::format("after {:.6g} s body '{}' moves at {:.3g} m/s, energy {:.3g} J", simulation.time(), body,
                     fastest, energy);
}

Measured Simulate(Simulation& simulation, const RunArguments& args, std::int64_t steps,
                  const ControlTrack& track, const FidelityTrack& detail, std::optional<Recorder>& recorder,
                  Expected<void>& recorded) {
  Measured out;
  out.step_us.reserve(static_cast<std::size_t>(std::min<std::int64_t>(steps, 1 << 20)));
  out.energy_first = out.energy_last = simulation.Energy();
  ProgressBar bar("simulating");
  LoadWatch watch;
  std::size_t next_detail = 0;
  if (args.error) out.error.emplace();
  Passers passers(simulation);
  for (std::int64_t i = 0; i < steps; ++i) {
    Switch(detail, next_detail, simulation, out);
    track.Apply(static_cast<double>(i + 1) * simulation.dt(), simulation);
    if (out.error) out.error->Begin(simulation);
    const auto start = std::chrono::steady_clock::now();
    const StepReport report = simulation.Step();
    const std::chrono::duration<double, std::micro> spent = std::chrono::steady_clock::now() - start;
    if (out.error) out.error->End(simulation, report);
    if (!report.finite) {
      out.failed_step = i;
      break;
    }
    out.step_us.push_back(spent.count());
    out.contacts_max = std::max(out.contacts_max, report.contacts);
    out.unconverged += report.solver.converged && report.minimum_found ? 0 : 1;
    out.refreshes += report.refreshes;
    out.failed_refreshes += report.failed_refreshes;
    out.steps_at_bound += report.forces_at_bound > 0 ? 1 : 0;
    out.most_at_bound = std::max(out.most_at_bound, report.forces_at_bound);
    out.contacts_dropped |= report.contacts_dropped;
    WatchHolds(simulation, out);
    out.penetration_max = std::max(out.penetration_max, report.max_penetration);
    const double energy = simulation.Energy();
    out.energy_increase = std::max(out.energy_increase, energy - out.energy_last);
    out.energy_last = energy;
    out.gap_max = std::max(out.gap_max, simulation.JointGap());
    if (!args.no_load_factor) watch.Look(simulation, out);
    passers.Look(simulation, out.switches.size(), out);
    if (recorder)
      if (recorded = recorder->Append(simulation, report); !recorded) break;
    if (out.impossible = Impossible(simulation, energy); !out.impossible.empty()) break;
    bar.Update(static_cast<double>(i + 1) / static_cast<double>(steps));
  }
  passers.Keep(out);
  return out;
}

Json Summary(const Simulation& simulation, const Measured& m) {
  Json out;
  double wall = 0;
  for (double us : m.step_us) wall += us * 1e-6;
  std::vector<double> sorted = m.step_us;
  std::sort(sorted.begin(), sorted.end());
  auto percentile = [&](double p) {
    return sorted.empty() ? 0.0
                          : sorted[static_cast<std::size_t>(p * static_cast<double>(sorted.size() - 1))];
  };
  out["steps"] = m.step_us.size();
  out["dt_s"] = simulation.dt();
  out["simulated_s"] = simulation.time();
  out["wall_s"] = wall;
  out["real_time_factor"] = wall > 0 ? Json(simulation.time() / wall) : Json(nullptr);
  out["contacts_max"] = m.contacts_max;
  out["energy_J"] = {{"first", m.energy_first}, {"last", m.energy_last}, {"max_increase", m.energy_increase}};
  out["interface"] = Json::array();
  out["free_bodies"] = Json::array();
  for (std::size_t i = 0; i < simulation.bodies().size(); ++i) {
    const SceneBody& b = simulation.bodies()[i];
    if (!b.is_interface && b.mechanism >= 0) continue;
    const RigidTransform X = simulation.Pose(static_cast<int>(i));
    out[b.mechanism < 0 ? "free_bodies" : "interface"].push_back(
        {{"body", b.name},
         {"position_m", ToJson(X.translation())},
         {"quaternion_wxyz", ToJson(X.quaternion())}});
  }
  out["joint_gap_max_m"] = m.gap_max;
  out["penetration_max_m"] = m.penetration_max;
  const bool has_load = std::isfinite(m.load_min.factor);
  out["load_factor_min"] = has_load ? Json(m.load_min.factor) : Json(nullptr);
  if (m.error) m.error->AddTo(out);
  out["step_us"] = {{"median", percentile(0.5)}, {"p99", percentile(0.99)}};
  out["detail"] = Json::array();
  for (const Measured::Switch& s : m.switches)
    out["detail"].push_back({{"time_s", s.time},
                             {"level", Name(s.fidelity.level)},
                             {"modes", s.fidelity.modes >= 0 ? Json(s.fidelity.modes) : Json(nullptr)},
                             {"recovery", s.fidelity.recovery == Recovery::kTwist ? "twist" : "exact"},
                             {"took_ms", s.ms},
                             {"refused", s.refused.empty() ? Json(nullptr) : Json(s.refused)}});
  // What a contact that pulls uses of its friction has no bound.
  out["hold_use_max"] = m.held && std::isfinite(m.hold_use_max) ? Json(m.hold_use_max) : Json(nullptr);
  out["unconverged_steps"] = m.unconverged;
  out["refreshes"] = m.refreshes;
  out["servos_at_limit"] = {{"steps", m.steps_at_bound}, {"most", m.most_at_bound}};
  out["passed_through"] = Json::array();
  for (const Passing& p : m.passed)
    out["passed_through"].push_back({{"body", p.body},
                                     {"other", p.other},
                                     {"first_s", p.first},
                                     {"depth_max_m", p.depth},
                                     {"depth_max_s", p.when}});
  Json warnings = Json::array();
  for (const std::string& w : simulation.warnings()) warnings.push_back(w);
  if (m.contacts_dropped) warnings.push_back("the collision detector ran out of room and dropped contacts");
  constexpr std::size_t kTold = 5;  // the deepest; the others stand in `passed_through`
  for (std::size_t i = 0; i < std::min(kTold, m.passed.size()); ++i)
    warnings.push_back(fmt::format(
        "'{}' is no interface body, so it touches nothing: from {:.4g} s on it went into '{}', {:.3g} mm "
        "deep at "
        "{:.4g} s; add it to --interface",
        m.passed[i].body, m.passed[i].first, m.passed[i].other, 1e3 * m.passed[i].depth, m.passed[i].when));
  if (m.passed.size() > kTold)
    warnings.push_back(
        fmt::format("{} more pairs of bodies passed through each other", m.passed.size() - kTold));
  if (m.error)
    for (const std::string& w : m.error->Warnings()) warnings.push_back(w);
  if (m.failed_refreshes > 0)
    warnings.push_back(fmt::format("{} refreshes found no reduced model at their pose and kept the old one",
                                   m.failed_refreshes));
  if (m.load_min.factor < 1.3)  // springs and radii of a real hand are hardly known better than to a third
    warnings.push_back(
        fmt::format("load factor {:.3g} at {:.4g} s: '{}' is ejected if contact forces grow to "
                    "that multiple; press less or grasp stiffer",
                    m.load_min.factor, m.load_min_time, m.load_min.body));
  for (const Measured::Switch& s : m.switches)
    if (!s.refused.empty())
      warnings.push_back(fmt::format("at {:.4g} s the detail stayed as it was: {}", s.time, s.refused));
  if (m.held && m.hold_use_max > 1)
    warnings.push_back(
        std::isfinite(m.hold_use_max)
            ? fmt::format(
                  "a frozen contact needs {:.3g} times the friction it has: not frozen, it would slip",
                  m.hold_use_max)
            : std::string("a frozen contact pulls at what it holds: not frozen, it would part"));
  out["warnings"] = std::move(warnings);
  return out;
}

void Print(const Json& d) {
  auto number = [&](const char* key) { return d[key].get<double>(); };
  fmt::print("{} steps of {:.6g} s: {:.4g} s simulated in {:.4g} s ({:.1f} times real time)\n",
             d["steps"].get<std::size_t>(), number("dt_s"), number("simulated_s"), number("wall_s"),
             d["real_time_factor"].is_null() ? 0.0 : number("real_time_factor"));
  fmt::print("  step            {:.1f} us median, {:.1f} us at the 99th percentile\n",
             d["step_us"]["median"].get<double>(), d["step_us"]["p99"].get<double>());
  fmt::print("  contacts        {} at most, penetration {:.4f} mm at most, {} steps not converged\n",
             d["contacts_max"].get<int>(), 1e3 * number("penetration_max_m"),
             d["unconverged_steps"].get<int>());
  const Json& e = d["energy_J"];
  fmt::print("  energy          {:.6g} J first, {:.6g} J last, largest rise in a step {:.3g} J\n",
             e["first"].get<double>(), e["last"].get<double>(), e["max_increase"].get<double>());
  fmt::print("  joint gap       {:.3g} mm at most\n", 1e3 * number("joint_gap_max_m"));
  fmt::print("  refreshes       {}\n", d["refreshes"].get<int>());
  if (const Json& servos = d["servos_at_limit"]; servos["steps"].get<int>() > 0)
    fmt::print("  servos          {} at most at the limit of their force, in {} steps\n",
               servos["most"].get<int>(), servos["steps"].get<int>());
  for (const Json& s : d["detail"])
    if (s["refused"].is_null() && s["time_s"].get<double>() > 0)
      fmt::print("  detail          {} from {:.4g} s on, changed in {:.2f} ms\n",
                 s["level"].get<std::string>(), s["time_s"].get<double>(), s["took_ms"].get<double>());
  if (!d["hold_use_max"].is_null())
    fmt::print("  frozen contacts use {:.2f} of their friction at most\n", number("hold_use_max"));
  if (!d["load_factor_min"].is_null())
    fmt::print("  load factor     {:.3f} at least\n", number("load_factor_min"));
  if (d.contains("accuracy")) PrintAccuracy(d["accuracy"]);
  if (d.contains("error_estimate_mm")) PrintErrorEstimate(d);
  for (const char* kind : {"interface", "free_bodies"})
    for (const Json& b : d[kind]) {
      const Json& p = b["position_m"];
      fmt::print("  {:<15} at ({:.5f}, {:.5f}, {:.5f}) m\n", b["body"].get<std::string>(), p[0].get<double>(),
                 p[1].get<double>(), p[2].get<double>());
    }
  for (const Json& w : d["warnings"]) fmt::print("  warning: {}\n", w.get<std::string>());
}

// With the detail of the first entry if that begins at once.
Expected<Simulation> Prepare(const RunArguments& args, ImportedScene& imported, const FidelityTrack& detail) {
  SimulationOptions options;
  options.dt = args.dt;
  options.recovery = args.recovery == "twist" ? Recovery::kTwist : Recovery::kExact;
  options.step.integrator = args.step_integrator;
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

// The run with one setting, for its error alone.
Expected<AccuracyTrial> TryOut(const RunArguments& args, ImportedScene imported, const ControlTrack& track,
                               const AccuracySetting& setting) {
  RunArguments with = args;
  with.dt = setting.dt;
  with.step_integrator = setting.integrator;
  with.refresh_angle = setting.refresh_angle;
  if (setting.modes >= 0)
    for (MechanismDef& m : imported.scene.mechanisms) m.modes = setting.modes;
  auto simulation = Prepare(with, imported, {});
  if (!simulation) return tl::unexpected(simulation.error());
  const auto steps = CountSteps(args.time, simulation->dt());
  if (!steps) return tl::unexpected(steps.error());
  track.Apply(0, *simulation);
  AccuracyTrial trial;
  trial.setting = setting;
  trial.exact = with.recovery != "twist";
  for (const MechanismDynamics& m : simulation->world().mechanisms()) {
    trial.modes_kept = std::max(trial.modes_kept, m.model().num_modes);
    trial.leaves_something |= m.model().has_complement;
  }
  ErrorWatch watch;
  ProgressBar bar("trying");
  for (std::int64_t i = 0; i < *steps && trial.finite; ++i) {
    track.Apply(static_cast<double>(i + 1) * simulation->dt(), *simulation);
    watch.Begin(*simulation);
    const StepReport report = simulation->Step();
    trial.finite = report.finite;
    trial.touches |= report.contacts > 0;
    if (trial.finite) watch.End(*simulation, report);
    bar.Update(static_cast<double>(i + 1) / static_cast<double>(*steps));
  }
  trial.error = watch.largest();
  trial.finite &= trial.error.finite;
  return trial;
}

int Run(const RunArguments& given) {
  RunArguments args = given;
  const bool json = args.model.json;
  if (auto ok = RefuseInputs(args.record, {args.model.path, args.controls}); !ok)
    return Report(ok.error(), json);
  auto imported = args.model.Load();
  if (!imported) return Report(imported.error(), json);
  if (!json) PrintNotes(imported->report);
  FidelityTrack detail;
  if (!args.detail.empty()) {
    Fidelity initial;
    initial.recovery = args.recovery == "twist" ? Recovery::kTwist : Recovery::kExact;
    auto read = FidelityTrack::Parse(args.detail, initial);
    if (!read) return Report(read.error(), json);
    detail = std::move(*read);
  }
  std::optional<AccuracyChoice> choice;
  if (!args.accuracy.empty()) {
    const auto wanted = ParseAccuracy(args.accuracy);
    if (!wanted) return Report(wanted.error(), json);
    ControlTrack inputs;
    if (!args.controls.empty()) {
      auto read = ReadControls(args.controls);
      if (!read) return Report(read.error(), json);
      inputs = std::move(*read);
    }
    const AccuracySetting first{args.dt > 0 ? args.dt : imported->scene.timestep, args.step_integrator, -1,
                                args.refresh_angle};
    auto made = ChooseForAccuracy(
        *wanted, first, !args.integrator_given,
        [&](const AccuracySetting& setting) { return TryOut(args, *imported, inputs, setting); });
    if (!made) return Report(made.error(), json);
    choice = std::move(*made);
    const AccuracySetting& best = choice->trials[choice->chosen].setting;
    args.dt = best.dt;
    args.step_integrator = best.integrator;
    args.refresh_angle = best.refresh_angle;
    args.error = true;
    if (best.modes >= 0)
      for (MechanismDef& m : imported->scene.mechanisms) m.modes = best.modes;
  }
  auto simulation = Prepare(args, *imported, detail);
  if (!simulation) return Report(simulation.error(), json);
  const auto steps = CountSteps(args.time, simulation->dt());
  if (!steps) return Report(steps.error(), json);

  ControlTrack track;
  if (!args.controls.empty()) {
    auto read = ReadControls(args.controls);
    if (!read) return Report(read.error(), json);
    track = std::move(*read);
    if (const auto missing = track.FindMissing(*simulation); !missing.empty()) {
      std::string known;
      for (const std::string& n : simulation->control_names()) known += (known.empty() ? "" : ", ") + n;
      return Report({ErrorCode::kModel, args.controls,
                     fmt::format("column '{}' is no control of this model; there are: {}", missing.front(),
                                 known.empty() ? "none" : known)},
                    json);
    }
    track.Apply(0, *simulation);
  }
  std::optional<Recorder> recorder;
  Expected<void> recorded;
  if (!args.record.empty()) {
    auto created = Recorder::Create(args.record, *simulation);
    if (!created) return Report(created.error(), json);
    recorder.emplace(std::move(*created));
  }
  const Measured measured = Simulate(*simulation, args, *steps, track, detail, recorder, recorded);
  if (recorder && recorded) recorded = recorder->Finish();

  Json summary = Summary(*simulation, measured);
  summary["notes"] = NotesJson(imported->report);
  if (choice) {
    summary["accuracy"] = AccuracyJson(args.accuracy, *choice);
    if (!choice->met)
      summary["warnings"].push_back(
          fmt::format("--accuracy {} was not met by any of {} settings that were tried", args.accuracy,
                      choice->trials.size()));
  }
  if (json)
    fmt::print("{}\n", ToText(summary, 2));
  else
    Print(summary);
  if (!recorded) return Report(recorded.error(), false);
  if (!args.record.empty()) fmt::print(stderr, "recorded to {}\n", args.record);
  if (!measured.impossible.empty())
    return Report(
        {ErrorCode::kNumerics, args.model.path,
         measured.impossible + ": the motion has blown up. Try a smaller --dt, --integrator theta, more "
                               "--modes, or controls that move more slowly"},
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
  command->add_option("--time", args->time, "seconds to simulate (default 2)")
      ->check(NumberWithin(0, kMostSeconds));
  command->add_option("--dt", args->dt, "time step in s (default 1/60)")->check(PositiveUpTo(kMostStep));
  command->add_option("--controls", args->controls, "CSV of control values: time,NAME,...");
  AddIntegratorTo(*command, args->step_integrator);
  command->add_option("--recovery", args->recovery, "exact or twist")
      ->check(CLI::IsMember({"exact", "twist"}));
  command->add_option("--detail", args->detail,
                      "how much is simulated, from what time on: [TIME:]WORD[+WORD...],... with object, "
                      "interface, parents, all, modes=K, exact, twist; as in interface,2:object");
  command->add_option("--record", args->record, "write a recording to this HDF5 file");
  command
      ->add_option(
          "--accuracy", args->accuracy,
          "how far off the run may be, as in 0.5mm or 1% of the motion: tries it with other dt, "
          "integrator, modes and refresh angles until its estimated error is below that, and says what "
          "it chose")
      ->excludes("--detail");
  command->add_flag("--error", args->error,
                    "estimate how far the run is from the truth: what the reduction leaves out, what bends "
                    "within a step, and the time step");
  command->add_flag("--no-load-factor", args->no_load_factor,
                    "do not watch how much harder a grasp may press before it ejects what it holds");
  command->callback([&action, args, command] {
    args->integrator_given = command->count("--integrator") > 0;
    action = [args] { return Run(*args); };
  });
}

}  // namespace fork1s::app
