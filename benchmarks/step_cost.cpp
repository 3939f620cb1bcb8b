// What a step costs beside mj_step on the same file, time step and contacts, collision counted on both sides.
//
//     build/release/benchmarks/step_cost MODEL [CONTROLS.csv [SECONDS [FROM]]]
//
// Both run in one process, step by step in turn. Before each of its steps MuJoCo gets our joint positions,
// base and free-body poses and controls, so that both see the same contacts; its warm start is its own. Only
// steps after FROM seconds count. Prints one CSV row: medians in µs and their ratio, and what the reduction
// of all mechanisms took at the start.
#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fork1s/base/percentile.hpp>
#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/csv.hpp>
#include <fork1s/sim/simulation.hpp>
#include <memory>
#include <string>
#include <vector>

#include "benchmarks.hpp"
#include "mujoco_copier.hpp"

namespace fork1s::benchmarks::step_cost {
namespace {
using Clock = std::chrono::steady_clock;

double ReductionMs(const Simulation& simulation) {
  double sum = 0;
  for (const MechanismDynamics& m : simulation.world().mechanisms()) {
    ReductionOptions options;
    options.interfaces = m.model().interfaces;
    std::vector<double> ms;
    for (int i = 0; i < 21; ++i) {
      const auto start = Clock::now();
      if (!Reduce(m.model().mechanism, m.model().q_ref, options)) return -1;
      ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - start).count());
    }
    sum += Median(ms);
  }
  return sum;
}

int Measure(int argc, char** argv) {
  const std::string path = argv[1];
  const double seconds = argc > 3 ? std::atof(argv[3]) : 4, from = argc > 4 ? std::atof(argv[4]) : 1;
  auto imported = LoadMechanism(path);
  if (!imported) {
    fmt::print(stderr, "{}\n", imported.error().Text());
    return 3;
  }
  auto simulation = Simulation::Create(imported->scene);
  if (!simulation) {
    fmt::print(stderr, "{}\n", simulation.error().Text());
    return 3;
  }
  ControlTrack track;
  if (argc > 2 && std::string(argv[2]) != "-") {
    auto read = ReadControls(argv[2]);
    if (!read) {
      fmt::print(stderr, "{}\n", read.error().Text());
      return 3;
    }
    track = std::move(*read);
  }
  char error[1000] = "";
  std::unique_ptr<mjModel, void (*)(mjModel*)> m(mj_loadXML(path.c_str(), nullptr, error, sizeof error),
                                                 mj_deleteModel);
  if (!m) {
    fmt::print(stderr, "{}\n", error);
    return 3;
  }
  m->opt.timestep = simulation->dt();
  const double reduction_ms = ReductionMs(*simulation);
  std::unique_ptr<mjData, void (*)(mjData*)> d(mj_makeData(m.get()), mj_deleteData);
  const MuJoCoCopier copier(*simulation, m.get());

  std::vector<double> ours, theirs;
  double our_contacts = 0, their_contacts = 0;
  const int steps = static_cast<int>(seconds / simulation->dt());
  for (int i = 0; i < steps; ++i) {
    track.Apply((i + 1) * simulation->dt(), *simulation);
    copier.Copy(d.get());
    mju_zero(d->qvel, static_cast<int>(m->nv));
    auto start = Clock::now();
    mj_step(m.get(), d.get());
    const double mujoco_us = std::chrono::duration<double, std::micro>(Clock::now() - start).count();
    start = Clock::now();
    const StepReport report = simulation->Step();
    const double our_us = std::chrono::duration<double, std::micro>(Clock::now() - start).count();
    if (i * simulation->dt() < from) continue;
    theirs.push_back(mujoco_us);
    ours.push_back(our_us);
    our_contacts += report.contacts;
    their_contacts += d->ncon;
  }
  const auto count = static_cast<double>(std::max<std::size_t>(ours.size(), 1));
  const double a = Median(ours), b = Median(theirs);
  fmt::print("model,dt_s,contacts_ours,contacts_mujoco,step_us_ours,step_us_mujoco,ratio,reduction_ms\n");
  fmt::print("{},{:.5f},{:.1f},{:.1f},{:.2f},{:.2f},{:.3f},{:.3f}\n", path, simulation->dt(),
             our_contacts / count, their_contacts / count, a, b, a / b, reduction_ms);
  return 0;
}

}  // namespace

int Main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: step_cost MODEL [CONTROLS.csv|- [SECONDS [FROM]]]\n");
    return 2;
  }
  return Measure(argc, argv);
}

}  // namespace fork1s::benchmarks::step_cost
