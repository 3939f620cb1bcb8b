// The reduced simulation and MuJoCo at one time step, each against a converged run of the full model.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/mechanism/scene.hpp>
#include <fork1s/sim/simulation.hpp>
#include <fork1s/study/compare.hpp>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace fork1s {

/// What a simulator outside this process did.
struct PeerMotion {
  std::vector<double> step_s;                   // wall time of every step
  std::vector<std::vector<Vector3>> positions;  // [sample][body], m: the start, then every PeerOptions::dt
};

/// What takes part: the reduced simulation, MuJoCo with one of its integrators, or another simulator.
struct PeerEntrant {
  std::string name;  // as the table calls it
  bool is_mujoco = false;
  MuJoCoIntegrator integrator = MuJoCoIntegrator::kOfFile;
  bool tuned = false;  // loops with a time constant of 2 ms, elliptic friction cones, impratio 10
  int substeps = 1;    // it steps by PeerOptions::dt over this
  /// Moves these bodies of the scene for as many samples; an error is why it does not, and its row says so.
  std::function<Expected<PeerMotion>(const Scene& scene, const std::vector<std::string>& bodies, double dt,
                                     int samples, int substeps)>
      outside = {};
  Integrator own_integrator = Integrator::kTwoStage;  // of the reduced simulator
};

struct PeerOptions {
  std::string scene;        // as the table calls it
  std::string model_path;   // MJCF
  std::string mujoco_path;  // what MuJoCo runs in its place, with the same names; empty: the same file
  std::string keyframe;     // where the run starts; empty: the file's reference pose
  ControlTrack controls;
  double time = 1;          // s
  double dt = 1.0 / 60;     // s, of the runs that are compared
  int truth_substeps = 64;  // the full model's finest step is dt over this; the next to it is twice as long
  int rounds = 5;           // every run is repeated as often, in turn, so that all meet the same other load
  std::vector<PeerEntrant> entrants;     // at least one; the first is what ratios are over
  std::function<void(double)> progress;  // called with the share of the runs that are done
};

/// One simulator at one step. Errors are of the origins of interface and free bodies at every multiple of
/// PeerOptions::dt, from the full model's at its finest step.
struct PeerRow {
  std::string scene;
  std::string simulator;  // "fork1s", "MuJoCo Euler", "MuJoCo discrete, tuned", ..., "full", "full euler"
  double dt_s = 0;
  double time_s = 0;      // simulated
  bool survived = false;  // MuJoCo: none of its warnings of bad positions, speeds or accelerations
  std::string end;        // how it ended where it did not
  double rms_mm = 0, max_mm = 0;
  double error_percent = std::numeric_limits<double>::quiet_NaN();  // rms_mm over what the truth moves, RMS;
                                                                    // none where that is below 1 um
  double step_us = 0;                                               // median over all steps of all rounds
  double p99_us = 0, worst_us = 0;  // over steps, of each step's median over the rounds: what interrupts one
                                    // round does not count, what a step always costs does
  int refreshes = 0;                // fork1s: steps in which a mechanism was reduced again, and their median
  double refresh_step_us = 0;
  double step_ratio = 0;  // over fork1s at dt
  bool has_loops = false;
  double loop_gap_mm = 0;    // largest opening of a loop, of poses at every multiple of PeerOptions::dt
  double loop_turn_deg = 0;  // and turn of one that should not turn; not measured in the full model
};

/// Rows in the order of the entrants. Behind those that step by dt: the full model at dt, by two stages and by
/// backward Euler. Last: the full model at twice its finest step, whose error says how far the truth is to be
/// trusted. An entrant that MuJoCo refuses has a row that says so. Errors: as of LoadMechanism,
/// Simulation::Create and FullSimulation::Create; kModel for an unknown control.
Expected<std::vector<PeerRow>> MeasurePeers(const PeerOptions& options);

}  // namespace fork1s
