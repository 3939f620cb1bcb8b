// The steps whose instructions tools/step_instructions.sh counts under valgrind: ours, and mj_step on the
// same file at the same time step.
//
//     build/release/benchmarks/step_instructions MODEL [CONTROLS.csv|- [SECONDS [discrete]]]
//
// MuJoCo integrates as the file says, or with `discrete`.
// Before each of its steps MuJoCo gets our joint positions, base and free-body poses and controls, so that
// both see the same contacts. Prints the number of steps and how many contacts each saw in the mean.
#include <fmt/format.h>
#include <mujoco/mujoco.h>
#include <oneapi/tbb/global_control.h>

#include <cmath>
#include <cstdlib>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/csv.hpp>
#include <fork1s/sim/simulation.hpp>
#include <memory>
#include <string>

#include "benchmarks.hpp"
#include "mujoco_copier.hpp"

namespace fork1s::benchmarks::step_instructions {
namespace {

constexpr double kTimeStep = 1.0 / 60;  // s

int Refuse(const std::string& why) {
  fmt::print(stderr, "step_instructions: {}\n", why);
  return 3;
}

int Walk(int argc, char** argv) {
  // Work that other threads do would be counted in none of the steps.
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  const std::string path = argv[1];
  const double seconds = argc > 3 ? std::atof(argv[3]) : 1;
  auto imported = LoadMechanism(path);
  if (!imported) return Refuse(imported.error().Text());
  SimulationOptions options;
  options.dt = kTimeStep;
  auto simulation = Simulation::Create(imported->scene, options);
  if (!simulation) return Refuse(simulation.error().Text());
  ControlTrack track;
  if (argc > 2 && std::string(argv[2]) != "-") {
    auto read = ReadControls(argv[2]);
    if (!read) return Refuse(read.error().Text());
    track = std::move(*read);
  }
  char error[1000] = "";
  std::unique_ptr<mjModel, void (*)(mjModel*)> m(mj_loadXML(path.c_str(), nullptr, error, sizeof error),
                                                 mj_deleteModel);
  if (!m) return Refuse(error);
  m->opt.timestep = kTimeStep;
  if (argc > 4 && std::string(argv[4]) == "discrete") m->opt.integrator = mjINT_DISCRETE;
  std::unique_ptr<mjData, void (*)(mjData*)> d(mj_makeData(m.get()), mj_deleteData);
  const MuJoCoCopier copier(*simulation, m.get());

  const int steps = static_cast<int>(std::lround(seconds / kTimeStep));
  double our_contacts = 0, their_contacts = 0;
  for (int i = 0; i < steps; ++i) {
    track.Apply((i + 1) * kTimeStep, *simulation);
    mju_zero(d->qvel, static_cast<int>(m->nv));
    copier.Copy(d.get());
    mj_step(m.get(), d.get());
    our_contacts += simulation->Step().contacts;
    their_contacts += d->ncon;
  }
  fmt::print("{} {:.1f} {:.1f}\n", steps, our_contacts / steps, their_contacts / steps);
  return 0;
}

}  // namespace

int Main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "usage: step_instructions MODEL [CONTROLS.csv|- [SECONDS [discrete]]]\n");
    return 2;
  }
  return Walk(argc, argv);
}

}  // namespace fork1s::benchmarks::step_instructions
