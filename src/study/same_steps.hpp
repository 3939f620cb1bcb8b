// Steps of fork1s and of MuJoCo from the same poses: what one costs beside the other.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/sim/simulation.hpp>
#include <fork1s/study/compare.hpp>
#include <string>
#include <vector>

namespace fork1s {

struct SameStepsOptions {
  std::string model_path;  // MJCF
  ControlTrack controls;
  double time = 1;  // s
  double from = 0;  // s, from when on steps count
  double dt = 0;    // s; 0: the scene's
  MuJoCoIntegrator integrator = MuJoCoIntegrator::kOfFile;
  Recovery recovery = Recovery::kExact;
  Integrator own_integrator = Integrator::kTwoStage;  // of ours
};

struct SameSteps {
  double dt_s = 0;
  int steps = 0;                                     // that count
  double contacts_ours = 0, contacts_mujoco = 0;     // mean
  std::vector<double> step_us_ours, step_us_mujoco;  // of each step
};

/// Steps both in one process, on one thread, in turn. Before each of its steps MuJoCo gets our joint
/// positions, base and free-body poses and controls, so that both see the same contacts; its joints are at
/// rest and its warm start is its own. Errors: as of LoadMechanism and Simulation::Create; kModel where
/// MuJoCo refuses the file or a control is unknown.
Expected<SameSteps> StepFromSamePoses(const SameStepsOptions& options);

}  // namespace fork1s
