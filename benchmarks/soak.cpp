// A scene for a simulated day: what grows, what creeps, what fails.
//
//     build/release/benchmarks/soak MODEL HOURS [CONTROLS.csv [BODY:FX,FY,FZ [TOLERANCE]]]
//
// The table of controls runs once and its last row is held. After an hour, when all has come to rest, BODY is
// pushed for half a second every ten, with the force [N] and with its opposite in turn, so that the scene
// never falls asleep and nothing but creep can carry it away: poses are compared between pushes with those of
// the first such moment. Prints one CSV row a simulated hour, the hash of the state at its end last; exit
// code 4 if a step was undone, did not converge, or dropped contacts.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/csv.hpp>
#include <fork1s/sim/simulation.hpp>
#include <limits>
#include <string>
#include <vector>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::soak {
namespace {

constexpr double kPeriod = 10, kPush = 0.5;  // s

struct Push {
  int body = -1;
  Vector3 force_W = Vector3::Zero();
};

// Since the row before.
struct Hour {
  long unconverged = 0, undone = 0, dropped = 0, refreshes = 0, failed_refreshes = 0;
  double energy_least = std::numeric_limits<double>::infinity(), energy_most = -energy_least;  // J
  double kinetic_most = 0, gap = 0, penetration = 0;                                           // J, m, m
};

double ResidentMb() {
  long pages = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%*d %ld", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  return static_cast<double>(pages) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

int Refuse(const std::string& text) {
  fmt::print(stderr, "{}\n", text);
  return 3;
}

// What is looked at for creep: bodies that touch, and free ones.
std::vector<int> Watched(const Simulation& simulation) {
  std::vector<int> watched;
  for (std::size_t b = 0; b < simulation.bodies().size(); ++b)
    if (simulation.bodies()[b].is_interface || simulation.bodies()[b].mechanism < 0)
      watched.push_back(static_cast<int>(b));
  return watched;
}

int Soak(int argc, char** argv) {
  auto model = LoadMechanism(argv[1]);
  if (!model) return Refuse(model.error().Text());
  SimulationOptions options;
  options.initial_keyframe = model->initial_keyframe;
  auto simulation = Simulation::Create(model->scene, options);
  if (!simulation) return Refuse(simulation.error().Text());
  ControlTrack track;
  if (argc > 3 && std::string(argv[3]) != "-") {
    auto read = ReadControls(argv[3]);
    if (!read) return Refuse(read.error().Text());
    track = std::move(*read);
    for (const std::string& name : track.FindMissing(*simulation)) return Refuse("no control '" + name + "'");
  }
  Push push;
  if (argc > 4) {
    const std::string text = argv[4];
    const std::size_t colon = text.find(':');
    push.body = simulation->FindBody(text.substr(0, colon));
    if (push.body < 0 || std::sscanf(text.c_str() + std::min(colon, text.size() - 1) + 1, "%lf,%lf,%lf",
                                     &push.force_W.x(), &push.force_W.y(), &push.force_W.z()) != 3)
      return Refuse("push: '" + text + "' is not BODY:FX,FY,FZ with a body of the scene");
  }
  if (argc > 5) simulation->step_options().contact.tolerance = std::atof(argv[5]);
  const double end = 3600 * std::atof(argv[2]);
  const double table_end = track.times.empty() ? 0 : track.times.back();
  // The moment that others are held against [s]: all has come to rest, after an hour or half of a shorter
  // run.
  const double settled = std::max(table_end + 2 * kPeriod, std::min(3600.0, end / 2));
  const double first = kPeriod * std::ceil(settled / kPeriod);
  const std::vector<int> watched = Watched(*simulation);
  std::vector<Vector3> at;
  std::vector<double> crept;

  fmt::print(
      "scene,hour,us_a_step,resident_mb,energy_least,energy_most,kinetic_most,loop_gap_mm,penetration_mm,"
      "creep_mm,creeps_most,"
      "unconverged,undone,dropped,refreshes,failed_refreshes,state\n");
  const std::string scene = std::filesystem::path(argv[1]).stem();
  Hour hour;
  bool well = true;
  int hours = 0;
  auto started = std::chrono::steady_clock::now();
  std::int64_t steps_before = 0, next_moment = 0;
  while (simulation->time() < end) {
    const double t = simulation->time();
    if (t <= table_end + 1) track.Apply(t + simulation->dt(), *simulation);
    if (push.body >= 0 && t >= first) {
      const auto period = static_cast<std::int64_t>(t / kPeriod);
      if (t - kPeriod * static_cast<double>(period) < kPush)
        simulation->ApplyWrench(push.body, period % 2 == 0 ? push.force_W : Vector3(-push.force_W),
                                Vector3::Zero(), simulation->Pose(push.body).translation());
    }
    const StepReport report = simulation->Step();
    hour.unconverged += !report.solver.converged;
    hour.undone += !report.finite;
    hour.dropped += report.contacts_dropped;
    hour.refreshes += report.refreshes;
    hour.failed_refreshes += report.failed_refreshes;
    hour.penetration = std::max(hour.penetration, report.max_penetration);
    if (simulation->steps() % 10 == 0) {
      const double kinetic = simulation->KineticEnergy(), energy = kinetic + simulation->PotentialEnergy();
      hour.kinetic_most = std::max(hour.kinetic_most, kinetic);
      hour.energy_least = std::min(hour.energy_least, energy);
      hour.energy_most = std::max(hour.energy_most, energy);
      hour.gap = std::max(hour.gap, simulation->ClosureGap());
    }
    // Half a second before a push of the first kind.
    const double moment = first + 2 * kPeriod * static_cast<double>(next_moment) - 0.5;
    if (simulation->time() >= moment) {
      ++next_moment;
      if (at.empty())
        for (int b : watched) at.push_back(simulation->Pose(b).translation());
      crept.assign(watched.size(), 0);
      for (std::size_t i = 0; i < watched.size(); ++i)
        crept[i] = 1000 * (simulation->Pose(watched[i]).translation() - at[i]).norm();
    }
    if (simulation->time() >= 3600.0 * (hours + 1) - 1e-6 || simulation->time() >= end) {
      ++hours;
      const auto now = std::chrono::steady_clock::now();
      const std::size_t worst =
          crept.empty()
              ? 0
              : static_cast<std::size_t>(std::max_element(crept.begin(), crept.end()) - crept.begin());
      fmt::print("{},{},{:.1f},{:.2f},{:.9g},{:.9g},{:.4g},{:.3g},{:.3g},{:.6g},{},{},{},{},{},{},{:016x}\n",
                 scene, hours,
                 std::chrono::duration<double, std::micro>(now - started).count() /
                     static_cast<double>(simulation->steps() - steps_before),
                 ResidentMb(), hour.energy_least, hour.energy_most, hour.kinetic_most, 1000 * hour.gap,
                 1000 * hour.penetration, crept.empty() ? 0 : crept[worst],
                 crept.empty() ? "" : simulation->bodies()[static_cast<std::size_t>(watched[worst])].name,
                 hour.unconverged, hour.undone, hour.dropped, hour.refreshes, hour.failed_refreshes,
                 simulation->HashState());
      std::fflush(stdout);
      well = well && hour.unconverged + hour.undone + hour.dropped == 0;
      hour = Hour();
      started = now;
      steps_before = simulation->steps();
    }
  }
  return well ? 0 : 4;
}

}  // namespace

int Main(int argc, char** argv) {
  if (argc < 3 || !(std::atof(argv[2]) > 0)) {
    std::fputs("usage: soak MODEL HOURS [CONTROLS.csv [BODY:FX,FY,FZ [TOLERANCE]]]\n", stderr);
    return 2;
  }
  try {
    return Soak(argc, argv);
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 4;
  }
  return 0;
}

}  // namespace fork1s::benchmarks::soak
