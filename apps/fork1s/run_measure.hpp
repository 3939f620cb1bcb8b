// A run, step by step, and what is watched beside it.
#pragma once

#include <fork1s/record/recording.hpp>
#include <fork1s/sim/load_factor.hpp>
#include <fork1s/sim/push.hpp>
#include <fork1s/sim/run_statistics.hpp>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "sim/error_figure.hpp"
#include "sim/interpenetration.hpp"

namespace fork1s::app {

/// What moves the run from outside.
struct RunInputs {
  ControlTrack controls;
  std::vector<PushTrack> pushes;  // of the table, of the command line
  FidelityTrack detail;
};

/// The pushes of the step that begins now, applied and as a recording keeps them.
std::vector<AppliedWrench> ApplyPushes(const RunInputs& inputs, double end, Simulation& simulation);

/// Whether the step that begins now has this detail.
bool IsDue(const FidelityTrack::Entry& entry, const Simulation& simulation);

/// What a run measures, step by step.
struct Measured {
  std::vector<double> step_us;
  int contacts_max = 0, unconverged = 0, refreshes = 0, failed_refreshes = 0;
  int expansions = 0, expanded_steps = 0;  // steps: of one mechanism or more
  RelinearizationTotals refreshes_by_cause;
  struct Solver {
    std::int64_t solves = 0, iterations = 0;  // steps with a contact that bore something
    int iterations_max = 0, helped = 0;       // steps in which Newton's method needed help
    int active_max = 0, sliding_max = 0;      // contacts
    double force_max = 0, speed_max = 0;      // N, m/s: residuals
  } solver;
  // Of the two-stage step. Names are those of the worst step; empty: none.
  struct Stages {
    std::int64_t stages = 0, iterations = 0;
    int iterations_max = 0;                          // of a stage
    int impacts = 0, saturations = 0, unsolved = 0;  // steps that were halved for these
    std::string impact, saturation, unsolved_of;     // what the last of them was about
    double residual_max = 0;                         // m
    std::string residual_of;
  } stages;
  bool failed_unsolved = false;  // failed_step was undone because its stages did not converge
  std::string failed_of;
  double energy_first = 0, energy_last = 0, energy_increase = 0;
  double gap_max = 0, penetration_max = 0;
  int steps_at_bound = 0, most_at_bound = 0;  // servos and motors that gave all they can
  bool contacts_dropped = false;
  std::int64_t failed_step = -1;
  std::string impossible;  // what a step ended with that no mechanism does; empty: nothing
  LoadFactor load_min;     // of what was still there at the next look
  double load_min_time = 0;
  struct Load {
    double time = 0;  // s
    LoadFactor load;
  };
  std::vector<Load> loads;  // over time, see LoadWatch
  RunStatistics statistics;
  struct Switch {
    double time = 0;  // s
    Fidelity fidelity;
    double ms = 0;
    std::string refused;  // why not; empty: done
  };
  std::vector<Switch> switches;
  std::optional<internal::ErrorFigure> error;
  std::vector<std::string> implausible;  // sentences of SanityMonitor
  std::vector<Interpenetration> passed;  // bodies that touch nothing, and went into something
  bool held = false;                     // contacts were frozen in some step
  double hold_use_max = 0;               // see FrozenContactForce
  struct BasePath {
    Vector3 start = Vector3::Zero(), last = Vector3::Zero();  // m, of the origin
    double length = 0;                                        // m
    double speed_max = 0;                                     // m/s
  };
  std::vector<BasePath> base_paths;  // of each mechanism's base
  // Joints that moved faster than their file allows, by name.
  struct Speeding {
    double limit = 0, speed = 0;  // rad/s or m/s: the fastest
    bool turns = true;
    double when = 0, first = 0;  // s
  };
  std::map<std::string, Speeding> speeding;
};

struct Watches {
  bool load_factor = true;
  bool error = false;
  std::map<std::string, double> velocity_limits = {};  // as of ImportReport
};

/// Runs `steps` steps; `recorded` says why the recorder failed, and the run ends there.
Measured Simulate(Simulation& simulation, const RunInputs& inputs, std::int64_t steps, const Watches& watches,
                  std::optional<Recorder>& recorder, Expected<void>& recorded);

}  // namespace fork1s::app
