// The reduced simulation beside another one on the same scene, inputs and start.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/importer/importer.hpp>
#include <fork1s/reference/full_simulation.hpp>
#include <fork1s/sim/push.hpp>
#include <fork1s/sim/simulation.hpp>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace fork1s {

enum class Against {
  kFull,    ///< FullSimulation: all bodies' coordinates, the whole step solved to rounding
  kMuJoCo,  ///< mj_step on the same file
};

/// How MuJoCo integrates.
enum class MuJoCoIntegrator {
  kOfFile,        ///< as the file says
  kEuler,         ///< semi-implicit, MuJoCo's default
  kImplicitFast,  ///< implicit in velocity-dependent forces
  kDiscrete,      ///< contacts solved in the metric M + hD + h²K, from MuJoCo 3.13 on
};

struct CompareOptions {
  Against against = Against::kFull;
  double time = 2;  // s
  double dt = 0;    // s; 0: the scene's time step
  Recovery recovery = Recovery::kExact;
  Integrator integrator = Integrator::kTwoStage;  // of the reduced run
  /// Of the full run; by default of the order of the reduced one's.
  std::optional<FullIntegrator> full_integrator;
  ControlTrack controls;
  PushTrack pushes;        // in every run
  FidelityTrack detail;    // of the reduced run
  int refinements = 2;     // further runs at dt/2, dt/4, ...
  std::string model_path;  // the MJCF file, for kMuJoCo
  std::string model_name;  // stands for it in messages; empty: its path
  MuJoCoIntegrator mujoco_integrator = MuJoCoIntegrator::kOfFile;
  std::function<void(double)> progress;  // called with the share done, in [0, 1]
};

/// How far a body strays from where the other simulator has it.
struct BodyDifference {
  std::string body;
  double rms_mm = 0, max_mm = 0;    // position of its origin
  double rms_deg = 0, max_deg = 0;  // rotation
};

struct EnergyDrift {
  double first_J = 0, last_J = 0, max_rise_J = 0;  // largest rise in a sampled interval
};

/// What a run at one time step costs and how far it is from the truth: the other simulator at its finest
/// step.
struct CostPoint {
  std::string simulator;  // "reduced", "full", "mujoco"
  double dt_s = 0, wall_s = 0;
  double rms_mm = 0, max_mm = 0;  // over all compared bodies
};

struct EqualStep {
  double dt_s = 0;
  double rms_mm = 0, max_mm = 0;                // reduced against the other at the same step
  double wall_reduced_s = 0, wall_other_s = 0;  // of Step alone
};

/// Two bodies that one of the simulators lets touch and the other does not. Still bodies are all "world".
struct ContactPair {
  std::string body_a, body_b;
  bool touched = false;  // in the run; of pairs that the reduced simulation has alone it is not recorded
};

/// One body's path and load in both runs, sampled every dt.
struct ComparedTrace {
  std::string body;
  std::vector<Vector3> reduced_m, other_m;              // position of its origin
  std::vector<Vector3> force_reduced_N, force_other_N;  // contact on the body, mean over the interval
};

struct Comparison {
  std::string scene, other;                       // "full" or "mujoco"
  Integrator integrator = Integrator::kEuler;     // of the reduced run
  std::optional<FullIntegrator> full_integrator;  // of the full run; none where the other is MuJoCo
  double dt_s = 0, other_dt_s = 0, time_s = 0;
  std::vector<BodyDifference> interface, free_bodies;
  double force_rms_N = 0, force_max_N = 0;  // of the difference, per body and interval
  double force_rms_percent = 0;  // of the other's RMS force; not a number where only the reduced run has any
  std::vector<double> frequencies_reduced_hz, frequencies_full_hz;  // at the start, mechanism after mechanism
  double gap_max_mm = 0;        // largest opening of a joint or loop in the reduced run
  double gap_max_other_mm = 0;  // in the other run; MuJoCo's is measured on its poses, loops only
  std::vector<ContactPair> pairs_only_other, pairs_only_reduced;  // against MuJoCo: contact pairs that differ
  std::vector<std::string> laws;     // against MuJoCo: sentences on contact, friction and loops
  std::vector<std::string> dropped;  // against MuJoCo: what of the file it has and the import left out
  EnergyDrift energy_reduced, energy_other;
  double wall_reduced_s = 0, wall_other_s = 0, wall_ratio = 0;  // of Step alone; other over reduced
  std::vector<EqualStep> equal_steps;
  std::vector<CostPoint> costs;
  int unconverged_reduced = 0, unconverged_other = 0;  // steps
  int halved_other = 0;  // steps of a full run by two stages that were taken in parts: something was met
  std::vector<std::string> warnings;

  std::vector<double> times_s;  // of the traces, 0 first
  std::vector<ComparedTrace> traces;
  std::vector<double> gap_reduced_mm, gap_other_mm;
};

/// Runs both and compares interface bodies and free bodies. Errors: as of Simulation::Create and
/// FullSimulation::Create; kNumerics where a run gives numbers that are not finite; kModel for controls that
/// the scene does not have; kUsage for files that MuJoCo cannot run.
Expected<Comparison> Compare(const ImportedScene& imported, const CompareOptions& options);

/// "euler" or "two-stage", "euler" or "two-stages": as the command line calls them.
std::string NameOf(Integrator integrator);
std::string NameOf(FullIntegrator integrator);
/// "reduced by two-stage, full by two-stages".
std::string IntegratorsText(const Comparison& comparison);

/// What to know before any percentage is read: sentences that name the contact pairs that differ. None
/// where both simulators let the same bodies touch.
std::vector<std::string> PairLines(const Comparison& comparison);

/// These, the laws that differ and what was dropped.
std::vector<std::string> DifferenceLines(const Comparison& comparison);

/// One self-contained HTML page with tables and plots. Errors: kFile.
Expected<void> WriteComparisonReport(const Comparison& comparison, const std::string& path);

}  // namespace fork1s
