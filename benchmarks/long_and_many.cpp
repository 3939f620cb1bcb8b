// Continuum arms of 90 and 1000 joints, and 100 hands in one scene: benchmarks/results/long_and_many.csv and
// the table of docs/scenes/long_and_many.md.
//
//     build/release/benchmarks/long_and_many [--out docs/scenes] [arms|hands]
//     build/release/benchmarks/long_and_many --parts      what the parts of a step of 10 and 100 hands take
//     build/release/benchmarks/long_and_many --record FILE.h5 arms|hands     a recording of the longest, or
//     the most
//
// About a minute on two idle cores. With a name it measures that half alone, prints it and writes nothing.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <continuum_arm.hpp>
#include <fork1s/record/recording.hpp>
#include <fork1s/reference/full_simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <fstream>
#include <lab/scene_table.hpp>
#include <many_hands.hpp>
#include <optional>

#include <oneapi/tbb/global_control.h>

#include "base/percentile.hpp"
#include "benchmarks.hpp"
#include "world/step_times.hpp"

namespace fork1s::benchmarks::long_and_many {
namespace {
using namespace fork1s::examples;
using Clock = std::chrono::steady_clock;

// What a run cost and met.
struct Row {
  std::string scene;
  double stiffness = 1;
  int threads = 1;
  int bodies = 0, joints = 0, coordinates = 0;  // those that move; joint coordinates; r and six a free body
  double time_s = 0, reduction_ms = 0, step_us = 0, step_99_us = 0, real_time_factor = 0;
  int contacts_max = 0, unconverged = 0;
  double penetration_mm = 0;
  // Of the tip from the full model at the same step; of the full model from itself at half of it.
  std::optional<double> rms_mm, max_mm, full_rms_mm, full_step_us;
};

double Microseconds(Clock::time_point from) {
  return std::chrono::duration<double, std::micro>(Clock::now() - from).count();
}

void Describe(const Simulation& simulation, Row& row) {
  const auto& mechanisms = simulation.world().mechanisms();
  for (const SceneBody& b : simulation.bodies())
    if (b.mechanism < 0 || b.index > 0 ||
        mechanisms[static_cast<std::size_t>(b.mechanism)].mechanism().base() != BaseKind::kFixed)
      ++row.bodies;
  row.coordinates = 6 * static_cast<int>(simulation.world().free_bodies().size());
  for (const MechanismDynamics& m : simulation.world().mechanisms()) {
    row.joints += m.mechanism().num_coordinates();
    row.coordinates += m.model().size();
  }
  std::vector<double> us;  // of all mechanisms together
  for (int i = 0; i < 9; ++i) {
    const auto start = Clock::now();
    for (const MechanismDynamics& m : simulation.world().mechanisms())
      if (!Reduce(m.model().mechanism, m.model().q_ref)) return;
    us.push_back(Microseconds(start));
  }
  row.reduction_ms = 1e-3 * Percentile(us, 0.5);
}

void SetTimes(const std::vector<double>& step_us, double dt, Row& row) {
  double sum = 0;
  for (double us : step_us) sum += us;
  row.time_s = dt * static_cast<double>(step_us.size());
  row.step_us = Percentile(step_us, 0.5);
  row.step_99_us = Percentile(step_us, 0.99);
  row.real_time_factor = row.time_s / (1e-6 * sum);
}

constexpr double kFrame = 1.0 / 60;  // s between samples

// Where the tip is every 1/60 s, as the reduced or the full simulation has it.
template <class Stepper>
std::vector<Vector3> TipPath(Stepper& stepper, Simulation& guide, int substeps, const ContinuumArm& arm,
                             std::vector<double>& step_us) {
  const ControlTrack motion = ContinuumArmMotion();
  const int tip = stepper.FindBody(fmt::format("link{}", arm.joints - 1));
  const int frames = static_cast<int>(motion.times.back() / kFrame + 0.5);
  std::vector<Vector3> path;
  for (int i = 0; i < frames * substeps; ++i) {
    motion.Apply((i + 1) * kFrame / substeps, guide);
    stepper.SetControls(guide.controls());
    const auto start = Clock::now();
    stepper.Step();
    step_us.push_back(Microseconds(start));
    if ((i + 1) % substeps == 0)
      path.push_back(stepper.Pose(tip) * Vector3(0.5 * arm.length / arm.joints, 0, 0));
  }
  return path;
}

void Distance(const std::vector<Vector3>& a, const std::vector<Vector3>& b, double& rms_mm, double& max_mm) {
  double sum = 0;
  max_mm = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double mm = 1e3 * (a[i] - b[i]).norm();
    sum += mm * mm;
    max_mm = std::max(max_mm, mm);
  }
  rms_mm = std::sqrt(sum / static_cast<double>(a.size()));
}

Expected<void> CompareArm(const ContinuumArm& arm, Row& row) {
  const Scene scene = ContinuumArmScene(arm);
  auto guide = Simulation::Create(scene), reduced = Simulation::Create(scene);
  if (!guide) return tl::unexpected(guide.error());
  std::vector<double> us;
  const std::vector<Vector3> path = TipPath(*reduced, *guide, 1, arm, us);
  std::vector<Vector3> full_path[2];
  for (int k : {0, 1}) {
    FullSimulationOptions options;
    options.dt = kFrame / (1 + k);
    auto full = FullSimulation::Create(scene, options);
    if (!full) return tl::unexpected(full.error());
    us.clear();
    full_path[k] = TipPath(*full, *guide, 1 + k, arm, us);
    if (k == 0) row.full_step_us = Percentile(us, 0.5);
  }
  double rms = 0, max = 0;
  Distance(path, full_path[0], rms, max);
  row.rms_mm = rms;
  row.max_mm = max;
  Distance(full_path[0], full_path[1], rms, max);
  row.full_rms_mm = rms;
  return {};
}

// None without a path.
Expected<std::optional<Recorder>> StartRecording(const std::string& path, const Simulation& simulation) {
  if (path.empty()) return std::optional<Recorder>();
  auto created = Recorder::Create(path, simulation);
  if (!created) return tl::unexpected(created.error());
  return std::optional<Recorder>(std::move(*created));
}

Expected<Row> MeasureArm(int joints, double stiffness, const std::string& record) {
  ContinuumArm arm;
  arm.joints = joints;
  arm.stiffness_scale = stiffness;
  const Scene scene = ContinuumArmScene(arm);
  auto simulation = Simulation::Create(scene);
  if (!simulation) return tl::unexpected(simulation.error());
  Row row;
  row.scene = scene.name;
  row.stiffness = stiffness;
  Describe(*simulation, row);
  auto recorder = StartRecording(record, *simulation);
  if (!recorder) return tl::unexpected(recorder.error());
  const ControlTrack motion = ContinuumArmMotion();
  std::vector<double> step_us;
  while (simulation->time() < motion.times.back() - 1e-9) {
    motion.Apply(simulation->time() + simulation->dt(), *simulation);
    const auto start = Clock::now();
    const StepReport report = simulation->Step();
    step_us.push_back(Microseconds(start));
    if (!report.finite) return Fail(ErrorCode::kNumerics, scene.name, "gave numbers that are not finite");
    row.contacts_max = std::max(row.contacts_max, report.contacts);
    row.penetration_mm = std::max(row.penetration_mm, 1e3 * report.max_penetration);
    row.unconverged += report.solver.converged ? 0 : 1;
    if (*recorder)
      if (auto ok = (*recorder)->Append(*simulation, report); !ok) return tl::unexpected(ok.error());
  }
  SetTimes(step_us, simulation->dt(), row);
  if (joints == 90 && stiffness == 1 && record.empty())
    if (auto ok = CompareArm(arm, row); !ok) return tl::unexpected(ok.error());
  return row;
}

Expected<Row> MeasureHands(int count, int threads, const std::string& record) {
  const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism,
                                          static_cast<std::size_t>(threads));
  ManyHands hands;
  hands.count = count;
  if (!record.empty()) hands.scenario.rest = -2.5;  // until the lift and a shake are seen
  auto simulation = CreateManyHands(FORK1S_SOURCE "/scenes/hand.xml", hands);
  if (!simulation) return tl::unexpected(simulation.error());
  Row row;
  row.scene = fmt::format("hands{}", count);
  row.threads = threads;
  Describe(*simulation, row);
  auto recorder = StartRecording(record, *simulation);
  if (!recorder) return tl::unexpected(recorder.error());
  Expected<void> written;
  const ManyHandsMeasurement m = RunManyHands(*simulation, hands, [&](const StepReport& report) {
    if (*recorder && written) written = (*recorder)->Append(*simulation, report);
  });
  if (!written) return tl::unexpected(written.error());
  if (!m.finite || m.held < count)
    return Fail(ErrorCode::kNumerics, row.scene, fmt::format("holds only {} of {} boxes", m.held, count));
  row.contacts_max = m.contacts_max;
  row.penetration_mm = 1e3 * m.penetration_max;
  row.unconverged = m.unconverged_closing + m.unconverged_rest;
  SetTimes(m.step_us, simulation->dt(), row);
  return row;
}

// Median times of the parts of a step, on one thread and on two: what does not get shorter runs on one.
Expected<void> PrintParts(int count) {
  const auto names = PartsOf({});
  std::vector<std::vector<double>> us[2];
  for (const int threads : {1, 2}) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism,
                                            static_cast<std::size_t>(threads));
    ManyHands hands;
    hands.count = count;
    auto simulation = CreateManyHands(FORK1S_SOURCE "/scenes/hand.xml", hands);
    if (!simulation) return tl::unexpected(simulation.error());
    StepPartTimes times;
    simulation->world().Watch(&times);
    auto& of = us[threads - 1];
    of.resize(names.size() + 1);
    RunManyHands(*simulation, hands, [&](const StepReport&) {
      const auto parts = PartsOf(times);
      for (std::size_t k = 0; k < parts.size(); ++k) of[k].push_back(1e6 * parts[k].second);
      of.back().push_back(1e6 * times.all);
    });
  }
  fmt::print("hands,part,us_one_thread,us_two_threads\n");
  for (std::size_t k = 0; k <= names.size(); ++k)
    fmt::print("{},\"{}\",{:.1f},{:.1f}\n", count, k < names.size() ? names[k].first : "a step",
               Percentile(us[0][k], 0.5), Percentile(us[1][k], 0.5));
  return {};
}

std::string CsvHead() {
  return "scene,stiffness,threads,bodies,joint_coordinates,coordinates,simulated_s,reduction_ms,step_us,"
         "step_99_us,real_time_factor,contacts_max,unconverged,penetration_mm,rms_mm,max_mm,full_rms_mm,"
         "full_step_us\n";
}

std::string Csv(const Row& r) {
  auto optional = [](const std::optional<double>& x) {
    return x ? fmt::format("{:.4g}", *x) : std::string();
  };
  return fmt::format("{},{},{},{},{},{},{:.4g},{:.4g},{:.4g},{:.4g},{:.4g},{},{},{:.4g},{},{},{},{}\n",
                     r.scene, r.stiffness, r.threads, r.bodies, r.joints, r.coordinates, r.time_s,
                     r.reduction_ms, r.step_us, r.step_99_us, r.real_time_factor, r.contacts_max,
                     r.unconverged, r.penetration_mm, optional(r.rms_mm), optional(r.max_mm),
                     optional(r.full_rms_mm), optional(r.full_step_us));
}

std::string Markdown(const std::vector<Row>& arms, const std::vector<Row>& hands) {
  std::string out =
      "| arm | stiffness | bodies | coordinates | reduction [ms] | us a step | times real time | "
      "penetration at most [mm] | steps not converged |\n|---|---|---|---|---|---|---|---|---|\n";
  for (const Row& r : arms)
    out += fmt::format("| {} joints | x {:g} | {} | {} | {:.2f} | {:.0f} | {:.0f} | {:.3f} | {} |\n",
                       r.joints, r.stiffness, r.bodies, r.coordinates, r.reduction_ms, r.step_us,
                       r.real_time_factor, r.penetration_mm, r.unconverged);
  out +=
      "\n| hands | threads | bodies | coordinates | us a step | 99 % of steps below [us] | times real time | "
      "contacts | penetration at most [mm] | steps not converged "
      "|\n|---|---|---|---|---|---|---|---|---|---|\n";
  for (const Row& r : hands)
    out += fmt::format("| {} | {} | {} | {} | {:.0f} | {:.0f} | {:.1f} | {} | {:.3f} | {} |\n",
                       r.scene.substr(5), r.threads, r.bodies, r.coordinates, r.step_us, r.step_99_us,
                       r.real_time_factor, r.contacts_max, r.penetration_mm, r.unconverged);
  for (const Row& r : arms)
    if (r.rms_mm)
      out += fmt::format(
          "\nThe tip of the {}-joint arm is {:.2f} mm RMS and {:.2f} mm at most from where the full model "
          "has it "
          "at the same step; the full model is {:.2f} mm RMS from itself at half that step. A step of it "
          "takes "
          "{:.0f} us, {:.0f} times as long.\n",
          r.joints, *r.rms_mm, *r.max_mm, *r.full_rms_mm, *r.full_step_us, *r.full_step_us / r.step_us);
  return out;
}

int Report(const Error& error) {
  fmt::print(stderr, "{}\n", error.Text());
  return 1;
}

int Usage() {
  fmt::print(stderr,
             "usage: long_and_many [--out FOLDER] [arms|hands], --parts or --record FILE.h5 arms|hands\n");
  return 1;
}

}  // namespace

int Main(int argc, char** argv) {
  const std::string source = FORK1S_SOURCE;
  std::string out = source + "/docs/scenes", record, only;
  bool parts = false;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--out" && i + 1 < argc)
      out = argv[++i];
    else if (argument == "--record" && i + 1 < argc)
      record = argv[++i];
    else if (argument == "--parts")
      parts = true;
    else if (argument == "arms" || argument == "hands")
      only = argument;
    else
      return Usage();
  }
  if (parts) {
    for (const int count : {10, 100})
      if (auto printed = PrintParts(count); !printed) return Report(printed.error());
    return 0;
  }
  if (!record.empty()) {
    if (only.empty()) return Usage();
    const auto row = only == "arms" ? MeasureArm(1000, 1, record) : MeasureHands(100, 2, record);
    return row ? 0 : Report(row.error());
  }
  std::vector<Row> arms, hands;
  std::string csv = CsvHead();
  auto add = [&](const Expected<Row>& row, std::vector<Row>& rows) {
    if (!row) return false;
    rows.push_back(*row);
    csv += Csv(*row);
    fmt::print("{}", Csv(*row));
    std::fflush(stdout);
    return true;
  };
  fmt::print("{}", csv);
  if (only != "hands")
    for (int joints : {90, 1000})
      for (double stiffness : {1.0, 100.0})
        if (auto row = MeasureArm(joints, stiffness, ""); !add(row, arms)) return Report(row.error());
  if (only != "arms")
    for (int count : {1, 10, 100})
      for (int threads : {1, 2})
        if (auto row = MeasureHands(count, threads, ""); !add(row, hands)) return Report(row.error());
  if (!only.empty()) return 0;
  if (auto written = ReplaceTable(out + "/long_and_many.md", Markdown(arms, hands)); !written)
    return Report(written.error());
  std::ofstream file(source + "/benchmarks/results/long_and_many.csv", std::ios::trunc);
  file << csv;
  file.close();
  if (!file) {
    fmt::print(stderr, "{}/benchmarks/results/long_and_many.csv cannot be written\n", source);
    return 1;
  }
  return 0;
}

}  // namespace fork1s::benchmarks::long_and_many
