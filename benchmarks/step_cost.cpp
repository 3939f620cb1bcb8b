// What a step costs beside mj_step on the same file, time step and contacts, collision counted on both sides.
//
//     build/release/benchmarks/step_cost MODEL [CONTROLS.csv [SECONDS [FROM]]]
//
// Both run in one process, step by step in turn, from the same poses. Only steps after FROM seconds count.
// Prints one CSV row: medians in µs and their ratio, and what the reduction of all mechanisms took at the
// start.
#include <fmt/format.h>

#include <chrono>
#include <cstdlib>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/csv.hpp>
#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <string>
#include <vector>

#include "base/percentile.hpp"
#include "benchmarks.hpp"
#include "study/same_steps.hpp"

namespace fork1s::benchmarks::step_cost {
namespace {
using Clock = std::chrono::steady_clock;

Expected<double> ReductionMs(const std::string& path) {
  auto imported = LoadMechanism(path);
  if (!imported) return tl::unexpected(imported.error());
  auto simulation = Simulation::Create(imported->scene);
  if (!simulation) return tl::unexpected(simulation.error());
  double sum = 0;
  for (const MechanismDynamics& m : simulation->world().mechanisms()) {
    ReductionOptions options;
    options.interfaces = m.model().interfaces;
    std::vector<double> ms;
    for (int i = 0; i < 21; ++i) {
      const auto start = Clock::now();
      if (auto model = Reduce(m.model().mechanism, m.model().q_ref, options); !model)
        return tl::unexpected(model.error());
      ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - start).count());
    }
    sum += Median(ms);
  }
  return sum;
}

int Refuse(const Error& error) {
  fmt::print(stderr, "{}\n", error.Text());
  return 3;
}

}  // namespace

int Main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "usage: step_cost MODEL [CONTROLS.csv|- [SECONDS [FROM]]]\n");
    return 2;
  }
  SameStepsOptions options;
  options.model_path = argv[1];
  if (argc > 2 && std::string(argv[2]) != "-") {
    auto read = ReadControls(argv[2]);
    if (!read) return Refuse(read.error());
    options.controls = std::move(*read);
  }
  options.time = argc > 3 ? std::atof(argv[3]) : 4;
  options.from = argc > 4 ? std::atof(argv[4]) : 1;
  const auto reduction_ms = ReductionMs(options.model_path);
  if (!reduction_ms) return Refuse(reduction_ms.error());
  const auto steps = StepFromSamePoses(options);
  if (!steps) return Refuse(steps.error());
  const double a = Median(steps->step_us_ours), b = Median(steps->step_us_mujoco);
  fmt::print("model,dt_s,contacts_ours,contacts_mujoco,step_us_ours,step_us_mujoco,ratio,reduction_ms\n");
  fmt::print("{},{:.5f},{:.1f},{:.1f},{:.2f},{:.2f},{:.3f},{:.3f}\n", options.model_path, steps->dt_s,
             steps->contacts_ours, steps->contacts_mujoco, a, b, a / b, *reduction_ms);
  return 0;
}

}  // namespace fork1s::benchmarks::step_cost
