// What it costs to take a model again about the present pose, and how far a step that does so stands out.
//
//     build/release/benchmarks/refresh_cost MODEL [CONTROLS.csv|- [SECONDS [TIMES]]]
//
// Runs the scene on one thread and, twenty times on the way, moves every mechanism's reference to its pose
// TIMES times, putting back what it was. Prints one CSV row: `refresh_us` is the median of those, of all
// mechanisms together; `step_us` is the median of the run's own steps, `refreshing_us` and
// `worst_refreshing_us` are of those that took a model again, and `worst_us` is of all but the first second.
// `counted` is how many refreshes of one mechanism were asked for beside the run's own;
// tools/refresh_instructions.sh divides by it.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/csv.hpp>
#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <string>
#include <vector>

#include "base/percentile.hpp"
#include "benchmarks.hpp"
#include "parallel/parallel_for.hpp"

namespace fork1s::benchmarks::refresh_cost {
namespace {

using Clock = std::chrono::steady_clock;

double Since(Clock::time_point start) {
  return std::chrono::duration<double, std::micro>(Clock::now() - start).count();
}

struct Cost {
  std::vector<double> step_us, refreshing_us, refresh_us;
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
    if (report.refreshes > 0) cost.refreshing_us.push_back(cost.step_us.back());
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
  const auto worst = [](const std::vector<double>& us, std::size_t from) {
    return us.size() <= from
               ? std::string("-")
               : fmt::format("{:.1f}", *std::max_element(us.begin() + static_cast<long>(from), us.end()));
  };
  const auto first_second = static_cast<std::size_t>(1 / simulation->dt());
  fmt::print(
      "scene,coordinates,reduced,counted,refreshes,refresh_us,step_us,refreshing_us,worst_refreshing_us,"
      "worst_us\n");
  fmt::print("{},{},{},{},{},{:.1f},{:.1f},{},{},{}\n", std::filesystem::path(argv[1]).stem().string(),
             coordinates, reduced, cost.counted, cost.refreshing_us.size(), Median(cost.refresh_us),
             Median(cost.step_us),
             cost.refreshing_us.empty() ? "-" : fmt::format("{:.1f}", Median(cost.refreshing_us)),
             worst(cost.refreshing_us, 0), worst(cost.step_us, first_second));
  return 0;
}

}  // namespace fork1s::benchmarks::refresh_cost
