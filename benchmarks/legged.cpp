// Machines on legs that stand for a minute: benchmarks/results/legged.csv and the tables of
// docs/scenes/legged.md.
//
//     build/release/benchmarks/legged [--models FOLDER] [--out docs/scenes] [hexapod|anymal|cassie|digit ...]
//     build/release/benchmarks/legged [--models FOLDER] --record FILE.h5 MACHINE [flat]     the first three
//     seconds
//
// About a minute on an idle core. With names it measures those alone, prints them and writes nothing.
#include <fmt/format.h>

#include <algorithm>
#include <fork1s/record/recording.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <fork1s/study/compare.hpp>
#include <fstream>
#include <lab/scene_table.hpp>
#include <optional>

#include "benchmarks.hpp"
#include "legged_mujoco.hpp"

namespace fork1s::benchmarks::legged {
namespace {
using namespace fork1s::examples;

constexpr double kSettling = 20, kTime = 80;  // s
constexpr double kFine = 1.0 / 960;           // s, of a run of MuJoCo for its feet alone
constexpr int kHalvings = 6;                  // of MuJoCo's step, from 1/60 s
constexpr LeggedRobot kRobots[] = {LeggedRobot::kHexapod, LeggedRobot::kAnymal, LeggedRobot::kCassie,
                                   LeggedRobot::kDigit};

// What MuJoCo does with one integrator; none: was not run, or did not stand.
struct MuJoCoColumns {
  std::optional<double> us, times;     // a step at the largest step that stands: median; times real time
  std::optional<double> dt, stiff_dt;  // s, the largest step that stands, and with 100 times the gains
  std::optional<double> feet_um, fine_feet_um;
};

struct Row {
  LeggedRobot robot = LeggedRobot::kHexapod;
  LeggedGround ground = LeggedGround::kFlat;
  int bodies = 0, reduced = 0, full = 0, mujoco = 0;  // the last three: velocities that a step solves for
  double reduced_us = 0, full_us = 0;                 // a step: median, mean
  double reduced_times = 0, full_times = 0;           // real time
  MuJoCoColumns euler, discrete;
  double feet_um = 0, feet_stiff_um = 0;
  double gap_um = 0, lean_deg = 0;
  int unconverged = 0;
  double rms_mm = 0, max_mm = 0, half_rms_mm = 0, half_max_mm = 0;
  bool has_mujoco = false;
};

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Expected<StandMeasurement> Run(const LeggedScene& legged, const SimulationOptions& options) {
  auto simulation = Simulation::Create(legged.imported.scene, options);
  if (!simulation) return tl::unexpected(simulation.error());
  StandMeasurement m = Stand(*simulation, legged, kSettling, kTime);
  if (!m.finite)
    return Fail(ErrorCode::kNumerics, legged.imported.scene.name, "gave numbers that are not finite");
  if (m.lean > 0.5) return Fail(ErrorCode::kNumerics, legged.imported.scene.name, "fell over");
  return m;
}

// The first of 1/60 s and its halves with which it stands.
Expected<std::optional<std::pair<double, MuJoCoStand>>> FirstStanding(const LeggedScene& legged,
                                                                      const std::string& file,
                                                                      bool discrete) {
  for (int k = 0; k <= kHalvings; ++k) {
    const double dt = 1.0 / 60 / (1 << k);
    auto stand = StandInMuJoCo(legged, file, discrete, dt, kSettling, kTime);
    if (!stand) return tl::unexpected(stand.error());
    if (stand->stood) return std::optional(std::pair(dt, *stand));
  }
  return std::optional<std::pair<double, MuJoCoStand>>();
}

Expected<Row> Measure(LeggedRobot robot, LeggedOptions options) {
  auto legged = LoadLegged(robot, options);
  if (!legged) return tl::unexpected(legged.error());
  options.gain_scale = 100;
  auto stiff = LoadLegged(robot, options);
  if (!stiff) return tl::unexpected(stiff.error());
  Row row;
  row.robot = robot;
  row.ground = options.ground;
  auto probe = Simulation::Create(legged->imported.scene, StandingOptions(*legged));
  if (!probe) return tl::unexpected(probe.error());
  row.bodies = static_cast<int>(probe->bodies().size());
  row.full = 6 * row.bodies;
  for (const MechanismDynamics& m : probe->world().mechanisms()) {
    row.reduced += m.num_velocities();
    row.full += m.mechanism().num_coordinates();
  }

  auto m = Run(*legged, StandingOptions(*legged));
  if (!m) return tl::unexpected(m.error());
  double all = 0;
  for (double us : m->step_us) all += us;
  row.reduced_us = Median(m->step_us);
  row.reduced_times = 1e6 * kTime / all;
  row.feet_um = 1e6 * m->foot_motion;
  row.gap_um = 1e6 * m->joint_gap;
  row.lean_deg = 57.29577951308232 * m->lean;
  row.unconverged = m->unconverged;
  if (m = Run(*stiff, StandingOptions(*stiff)); !m) return tl::unexpected(m.error());
  row.feet_stiff_um = 1e6 * m->foot_motion;
  row.gap_um = std::max(row.gap_um, 1e6 * m->joint_gap);
  row.unconverged += m->unconverged;

  CompareOptions compare;
  compare.time = 2;
  compare.refinements = 1;
  auto comparison = Compare(legged->imported, compare);
  if (!comparison) return tl::unexpected(comparison.error());
  const EqualStep& equal = comparison->equal_steps.front();
  row.rms_mm = equal.rms_mm;
  row.max_mm = equal.max_mm;
  row.full_us = 1e6 * equal.wall_other_s * equal.dt_s / comparison->time_s;
  row.full_times = comparison->time_s / equal.wall_other_s;
  for (const CostPoint& c : comparison->costs)
    if (c.simulator == "full" && c.dt_s == equal.dt_s) {
      row.half_rms_mm = c.rms_mm;
      row.half_max_mm = c.max_mm;
    }

  // Digit is not there: its rods need other joints than its file has.
  if (robot == LeggedRobot::kDigit) return row;
  const std::string file =
      robot == LeggedRobot::kHexapod
          ? options.scenes + (options.ground == LeggedGround::kFlat ? "/hexapod.xml" : "/hexapod_terrain.xml")
          : ModelFile(robot, options.models);
  row.has_mujoco = true;
  for (const bool discrete : {false, true}) {
    MuJoCoColumns& out = discrete ? row.discrete : row.euler;
    auto stand = FirstStanding(*legged, file, discrete);
    if (!stand) return tl::unexpected(stand.error());
    if (*stand) {
      out.dt = (*stand)->first;
      row.mujoco = (*stand)->second.coordinates;
      out.us = (*stand)->second.step_us;
      out.times = (*stand)->second.real_time_factor;
      out.feet_um = 1e6 * (*stand)->second.foot_motion;
    }
    auto fine = StandInMuJoCo(*legged, file, discrete, kFine, kSettling, kTime);
    if (!fine) return tl::unexpected(fine.error());
    if (fine->stood) out.fine_feet_um = 1e6 * fine->foot_motion;
    if (stand = FirstStanding(*stiff, file, discrete); !stand) return tl::unexpected(stand.error());
    if (*stand) out.stiff_dt = (*stand)->first;
  }
  return row;
}

std::string CsvHead() {
  std::string out =
      "machine,ground,bodies,reduced_coordinates,full_coordinates,mujoco_coordinates,reduced_step_us,"
      "full_step_us,reduced_real_time_factor,full_real_time_factor,feet_um,feet_x100_um,"
      "lean_deg,joint_gap_um,unconverged,rms_mm,max_mm,full_half_step_rms_mm,"
      "full_half_step_max_mm";
  for (const char* name : {"mujoco_euler", "mujoco_discrete"})
    out += fmt::format(
        ",{0}_step_us,{0}_real_time_factor,{0}_largest_dt_s,{0}_largest_dt_x100_s,{0}_feet_um,"
        "{0}_feet_960_Hz_um",
        name);
  return out + "\n";
}

std::string Csv(const Row& r) {
  auto text = [](const std::optional<double>& x) { return x ? fmt::format("{:.4g}", *x) : std::string(); };
  std::string out =
      fmt::format("{},{},{},{},{},{},", Name(r.robot), Name(r.ground), r.bodies, r.reduced, r.full,
                  r.mujoco > 0 ? fmt::format("{}", r.mujoco) : "") +
      fmt::format("{:.4g},{:.4g},{:.4g},{:.4g},", r.reduced_us, r.full_us, r.reduced_times, r.full_times) +
      fmt::format("{:.3g},{:.3g},{:.3g},{:.3g},{},", r.feet_um, r.feet_stiff_um, r.lean_deg, r.gap_um,
                  r.unconverged) +
      fmt::format("{:.3g},{:.3g},{:.3g},{:.3g}", r.rms_mm, r.max_mm, r.half_rms_mm, r.half_max_mm);
  for (const MuJoCoColumns* m : {&r.euler, &r.discrete})
    for (const auto& x : {m->us, m->times, m->dt, m->stiff_dt, m->feet_um, m->fine_feet_um})
      out += "," + text(x);
  return out + "\n";
}

std::string StepText(const Row& r, const std::optional<double>& dt) {
  if (!r.has_mujoco) return "-";
  return dt ? fmt::format("1/{:.0f}", 1 / *dt) : fmt::format("< 1/{}", 60 << kHalvings);
}

std::string Micrometres(const std::optional<double>& x) {
  return !x ? "-" : *x < 100 ? fmt::format("{:.2f}", *x) : fmt::format("{:.0f}", *x);
}

std::string Markdown(const std::vector<Row>& rows) {
  std::string out =
      "| machine, ground | bodies | coordinates: reduced, full, MuJoCo | us a step: reduced, full, MuJoCo "
      "Euler, discrete | times real time: reduced, full, MuJoCo Euler, discrete | largest step that stands "
      "[s]: reduced, MuJoCo Euler, discrete | the same, gains x 100 |\n|---|---|---|---|---|---|---|\n";
  const auto text = [](const std::optional<double>& x, int places) {
    return x ? fmt::format("{:.{}f}", *x, places) : std::string("-");
  };
  for (const Row& r : rows) {
    const std::string nv = r.mujoco > 0 ? fmt::format("{}", r.mujoco) : "-";
    out += fmt::format("| {}, {} | {} | {}, {}, {} | {:.1f}, {:.0f}, {}, {} | {:.0f}, {:.1f}, {}, {} |",
                       Name(r.robot), Name(r.ground), r.bodies, r.reduced, r.full, nv, r.reduced_us,
                       r.full_us, text(r.euler.us, 1), text(r.discrete.us, 1), r.reduced_times, r.full_times,
                       text(r.euler.times, 0), text(r.discrete.times, 0));
    out +=
        fmt::format(" 1/60, {}, {} | 1/60, {}, {} |\n", StepText(r, r.euler.dt), StepText(r, r.discrete.dt),
                    StepText(r, r.euler.stiff_dt), StepText(r, r.discrete.stiff_dt));
  }
  out +=
      "\n| machine, ground | feet in 60 s at most [um]: own gains, x 100 | "
      "MuJoCo Euler, own gains: largest step, 1/960 s | MuJoCo discrete: the same | trunk from upright "
      "[degrees] | joint gap [um] | steps not converged | reduced from full in 2 s, RMS and max [mm] | full "
      "from its own half step, RMS and max [mm] |\n"
      "|---|---|---|---|---|---|---|---|---|\n";
  for (const Row& r : rows)
    out += fmt::format(
        "| {}, {} | {:.2f}, {:.2f} | {}, {} | {}, {} | {:.2f} | {:.1g} | {} | {:.2g}, {:.2g} | "
        "{:.2g}, {:.2g} |\n",
        Name(r.robot), Name(r.ground), r.feet_um, r.feet_stiff_um, Micrometres(r.euler.feet_um),
        Micrometres(r.euler.fine_feet_um), Micrometres(r.discrete.feet_um),
        Micrometres(r.discrete.fine_feet_um), r.lean_deg, r.gap_um, r.unconverged, r.rms_mm, r.max_mm,
        r.half_rms_mm, r.half_max_mm);
  return out;
}

int Report(const Error& error) {
  fmt::print(stderr, "{}\n", error.Text());
  return 1;
}

int Record(LeggedRobot robot, const LeggedOptions& options, const std::string& path) {
  auto legged = LoadLegged(robot, options);
  if (!legged) return Report(legged.error());
  auto simulation = Simulation::Create(legged->imported.scene, StandingOptions(*legged));
  if (!simulation) return Report(simulation.error());
  auto recorder = Recorder::Create(path, *simulation);
  if (!recorder) return Report(recorder.error());
  while (simulation->time() < 3) {
    const StepReport report = simulation->Step();
    if (auto ok = recorder->Append(*simulation, report); !ok) return Report(ok.error());
  }
  return 0;
}

}  // namespace

int Main(int argc, char** argv) {
  const std::string source = FORK1S_SOURCE;
  LeggedOptions options;
  options.scenes = source + "/scenes";
  options.models = source + "/../shared/models";
  options.ground = LeggedGround::kUneven;
  std::string out = source + "/docs/scenes", record;
  std::vector<LeggedRobot> robots;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const auto named = std::find_if(std::begin(kRobots), std::end(kRobots),
                                    [&](LeggedRobot r) { return argument == Name(r); });
    if (argument == "--out" && i + 1 < argc)
      out = argv[++i];
    else if (argument == "--models" && i + 1 < argc)
      options.models = argv[++i];
    else if (argument == "--record" && i + 1 < argc)
      record = argv[++i];
    else if (argument == "flat")
      options.ground = LeggedGround::kFlat;
    else if (named != std::end(kRobots))
      robots.push_back(*named);
    else
      return fmt::print(
                 stderr,
                 "usage: legged [--models FOLDER] [--out FOLDER] [--record FILE.h5] [MACHINE...] [flat]\n"),
             1;
  }
  if (!record.empty()) return robots.empty() ? 1 : Record(robots.front(), options, record);
  const bool all = robots.empty();
  if (all) robots.assign(std::begin(kRobots), std::end(kRobots));
  std::vector<Row> rows;
  std::string csv = CsvHead();
  fmt::print("{}", csv);
  for (LeggedRobot robot : robots)
    for (LeggedGround ground : {LeggedGround::kFlat, LeggedGround::kUneven}) {
      options.ground = ground;
      options.gain_scale = 1;
      auto row = Measure(robot, options);
      if (!row) return Report(row.error());
      rows.push_back(*row);
      csv += Csv(*row);
      fmt::print("{}", Csv(*row));
      std::fflush(stdout);
    }
  if (!all) return 0;
  if (auto written = ReplaceTable(out + "/legged.md", Markdown(rows)); !written)
    return Report(written.error());
  std::ofstream file(source + "/benchmarks/results/legged.csv", std::ios::trunc);
  file << csv;
  file.close();
  if (!file) {
    fmt::print(stderr, "{}/benchmarks/results/legged.csv cannot be written\n", source);
    return 1;
  }
  return 0;
}

}  // namespace fork1s::benchmarks::legged
