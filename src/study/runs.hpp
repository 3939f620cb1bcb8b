// One simulator's run, sampled so that runs with other time steps can be held against it.
#pragma once

#include <fork1s/sim/push.hpp>
#include <fork1s/study/compare.hpp>
#include <functional>
#include <numeric>
#include <string>
#include <vector>

#include "world/step_times.hpp"

namespace fork1s::internal {

/// A body that is compared; `index` is its place in Simulation::bodies(), which is that of FullSimulation
/// too.
struct TrackedBody {
  std::string name;
  int index = 0;
  bool is_interface = false;
  int base_of = -1;  // mechanism whose floating base this is, where that is no interface body
};

struct Sample {
  std::vector<RigidTransform> X_WB;  // per tracked body
  std::vector<Vector3> force;        // contact on it, world axes, mean since the sample before [N]
  double energy = 0;                 // J
  double gap = 0;                    // m
  double loop_turn = 0;  // rad, largest turn of a loop that should not turn; not of the full model
};

struct Run {
  std::string simulator;
  double dt = 0;
  int unconverged = 0;          // steps
  std::vector<Sample> samples;  // the start, then one every interval
  std::vector<std::string> warnings;
  std::vector<double> step_s = {};        // wall time of every step
  std::vector<StepPartTimes> parts = {};  // of every step of the reduced run, where they were watched
  std::vector<char> refreshed = {};       // of the reduced run: steps in which a mechanism was reduced again
  int coordinates = 0;                    // velocities that the last step solved for
  int halved = 0;                         // steps of the full run by two stages that were taken in parts
  // MuJoCo only: bodies that touch in one of the two simulators alone.
  std::vector<ContactPair> pairs_only_here = {}, pairs_only_reduced = {};
  std::vector<std::string> laws = {};  // MuJoCo only: what it computes by other laws

  double wall_s() const { return std::accumulate(step_s.begin(), step_s.end(), 0.0); }  // of the steps alone
};

struct RunOptions {
  double interval = 0;  // s between samples
  int samples = 0;      // after the start
  int substeps = 1;     // steps an interval
  Recovery recovery = Recovery::kExact;
  Integrator integrator = Integrator::kTwoStage;  // of the reduced run
  FullIntegrator full_integrator = FullIntegrator::kTwoStages;
  int initial_keyframe = -1;
  const ControlTrack* controls = nullptr;
  const PushTrack* pushes = nullptr;
  const FidelityTrack* fidelity =
      nullptr;                     // of the reduced run; its first entry, if at 0, replaces `recovery`
  std::function<void()> progress;  // called after every sample
  MuJoCoIntegrator mujoco_integrator = MuJoCoIntegrator::kOfFile;
  bool mujoco_tuned =
      false;  // stiff loops and friction that creeps less than the file's defaults (mujoco_run.cpp)
  double mujoco_stiffness = 1;  // factor on its springs and servos, dampers by the root, as ScaleStiffness
  bool watch_parts = false;     // of the reduced run: Run::parts
  bool energy = true;           // of MuJoCo, which computes it within its step and so takes a little longer
};

/// How far [rad] the two sides of a closure are turned against each other where it does not let them.
double LoopTurn(const Mechanism& mechanism, const std::vector<RigidTransform>& X_RB);

/// Interface and free bodies of a scene.
std::vector<TrackedBody> TrackedBodies(const Simulation& simulation);

Expected<Simulation> MakeReduced(const Scene& scene, const RunOptions& options);

Expected<Run> RunReduced(const Scene& scene, const std::vector<TrackedBody>& tracked,
                         const RunOptions& options);
Expected<Run> RunFull(const Scene& scene, const std::vector<TrackedBody>& tracked, const RunOptions& options);
/// mj_step at `timestep`, 0 for the file's own. Bodies and actuators are found by name.
Expected<Run> RunMuJoCo(const std::string& path, const Scene& scene, const std::vector<TrackedBody>& tracked,
                        double timestep, const RunOptions& options);

}  // namespace fork1s::internal
