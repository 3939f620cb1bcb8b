// The steps whose instructions tools/step_instructions.sh counts under valgrind: ours, and mj_step on the
// same file from the same poses at the same time step.
//
//     build/release/benchmarks/step_instructions MODEL [CONTROLS.csv|- [SECONDS [discrete|- [RECOVERY
//     [euler|two-stage]]]]]
//
// MuJoCo integrates as the file says, or with `discrete`; ours as the scene chooses, or as told. Prints the
// number of steps and how many contacts each saw in the mean. `fork1s bench` counts the same steps.
#include <fmt/format.h>

#include <cstdlib>
#include <fork1s/record/csv.hpp>
#include <string>

#include "benchmarks.hpp"
#include "study/same_steps.hpp"

namespace fork1s::benchmarks::step_instructions {
namespace {

int Refuse(const std::string& why) {
  fmt::print(stderr, "step_instructions: {}\n", why);
  return 3;
}

}  // namespace

int Main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr,
               "usage: step_instructions MODEL [CONTROLS.csv|- [SECONDS [discrete|- [RECOVERY "
               "[euler|two-stage]]]]]\n");
    return 2;
  }
  SameStepsOptions options;
  options.model_path = argv[1];
  options.dt = 1.0 / 60;
  if (argc > 2 && std::string(argv[2]) != "-") {
    auto read = ReadControls(argv[2]);
    if (!read) return Refuse(read.error().Text());
    options.controls = std::move(*read);
  }
  if (argc > 3) options.time = std::atof(argv[3]);
  if (argc > 4 && std::string(argv[4]) == "discrete") options.integrator = MuJoCoIntegrator::kDiscrete;
  if (argc > 5) {
    const auto recovery = RecoveryNamed(argv[5]);
    if (!recovery) return Refuse(std::string("'") + argv[5] + "' is no recovery");
    options.recovery = *recovery;
  }
  if (argc > 6) {
    const std::string rule = argv[6];
    const auto integrator = IntegratorNamed(rule);
    if (!integrator) return Refuse("'" + rule + "' is none of: euler, two-stage");
    options.own_integrator = *integrator;
  }
  const auto steps = StepFromSamePoses(options);
  if (!steps) return Refuse(steps.error().Text());
  fmt::print("{} {:.1f} {:.1f}\n", steps->steps, steps->contacts_ours, steps->contacts_mujoco);
  return 0;
}

}  // namespace fork1s::benchmarks::step_instructions
