// What it costs to take a model anew about the present pose, and how far a step that does so stands out.
//
//     build/release/benchmarks/refresh_cost MODEL [CONTROLS.csv|- [SECONDS [TIMES]]]
//
// Runs the scene on one thread and, twenty times on the way, moves every mechanism's reference to its pose
// TIMES times, putting back what it was. `refresh_us` is the median of those, of all mechanisms together;
// `step_us`, `worst_us` and `refreshes` are of the run's own steps. Under `valgrind --tool=callgrind
// --toggle-collect='fork1s::MechanismDynamics::Refresh()'` only refreshes are counted
// (tools/refresh_cost.sh).
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fork1s/base/percentile.hpp>
#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/importer/importer.hpp>
#include <fork1s/parallel/parallel_for.hpp>
#include <fork1s/record/csv.hpp>
#include <fork1s/sim/simulation.hpp>
#include <string>
#include <vector>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::refresh_cost {
namespace {

using Clock = std::chrono::steady_clock;

double Since(Clock::time_point start) {
  return std::chrono::duration<double, std::micro>(Clock::now() - start).count();
}

struct Cost {
  std::vector<double> step_us, plain_us, refreshing_us, refresh_us;
  long counted = 0;  // refreshes that were asked for here
};

void RefreshAndPutBack(std::vector<MechanismDynamics>& mechanisms, int times, Cost& cost) {
  std::vector<MechanismState> before(mechanisms.size());
  for (std::size_t i = 0; i < before.size(); ++i) mechanisms[i].Save(before[i]);
  for (int k = 0; k < times; ++k) {
    double us = 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
      const auto start = Clock::now();
      mechanisms[i].Refresh();
      us += Since(start);
      ++cost.counted;
      mechanisms[i].Restore(before[i]);
    }
    cost.refresh_us.push_back(us);
  }
}

Cost Measure(Simulation& simulation, const ControlTrack& controls, double seconds, int times) {
  Cost cost;
  const int steps = std::max(1, static_cast<int>(seconds / simulation.dt()));
  const int every = std::max(1, steps / 20);
  for (int i = 0; i < steps; ++i) {
    controls.Apply((i + 1) * simulation.dt(), simulation);
    const auto start = Clock::now();
    const StepReport report = simulation.Step();
    cost.step_us.push_back(Since(start));
    (report.refreshes > 0 ? cost.refreshing_us : cost.plain_us).push_back(cost.step_us.back());
    if (i % every == every / 2) RefreshAndPutBack(simulation.world().mechanisms(), times, cost);
  }
  return cost;
}

int Refuse(const std::string& why) {
  fmt::print(stderr, "refresh_cost: {}\n", why);
  return 3;
}

}  // namespace

int Main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "usage: refresh_cost MODEL [CONTROLS.csv|- [SECONDS [TIMES]]]\n");
    return 2;
  }
  ControlTrack controls;
  if (argc > 2 && std::string(argv[2]) != "-") {
    auto read = ReadControls(argv[2]);
    if (!read) return Refuse(read.error().Text());
    controls = std::move(*read);
  }
  auto imported = LoadMechanism(argv[1]);
  if (!imported) return Refuse(imported.error().Text());
  auto simulation = Simulation::Create(imported->scene, SimulationOptions{});
  if (!simulation) return Refuse(simulation.error().Text());
  if (const auto missing = controls.FindMissing(*simulation); !missing.empty())
    return Refuse("no control '" + missing.front() + "'");
  int coordinates = 0, reduced = 0;
  for (const MechanismDynamics& m : simulation->world().mechanisms()) {
    coordinates += m.model().num_coordinates();
    reduced += m.model().size();
  }
  Cost cost;
  const double seconds = argc > 3 ? std::atof(argv[3]) : 10;
  const int times = argc > 4 ? std::atoi(argv[4]) : 20;
  WithThreads(1, [&] { cost = Measure(*simulation, controls, seconds, times); });
  const double step = Median(cost.step_us);
  fmt::print(
      "scene,coordinates,reduced,counted,refresh_us,step_us,worst_us,worst_over_median,refreshes,refreshing_"
      "us\n");
  fmt::print("{},{},{},{},{:.1f},{:.1f},{:.1f},{:.1f},{},{}\n",
             std::filesystem::path(argv[1]).stem().string(), coordinates, reduced, cost.counted,
             cost.refresh_us.empty() ? 0.0 : Median(cost.refresh_us), step,
             *std::max_element(cost.step_us.begin(), cost.step_us.end()),
             *std::max_element(cost.step_us.begin(), cost.step_us.end()) / step, cost.refreshing_us.size(),
             cost.refreshing_us.empty() ? "-" : fmt::format("{:.1f}", Median(cost.refreshing_us)));
  return 0;
}

}  // namespace fork1s::benchmarks::refresh_cost
