// What `fork1s bench` measures: models beside other simulators.
#pragma once

#include <fork1s/base/error.hpp>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "study/peers.hpp"
#include "study/stability.hpp"

namespace fork1s {

/// A simulator that is run as a program of its own: benchmarks/peers.
struct OutsidePeer {
  std::string name;                  // as tables call it
  std::vector<std::string> command;  // what runs it, the request's path comes behind
  std::string why_not;               // a sentence, where it cannot be run at all
};

/// Why the programs of benchmarks/peers cannot run a scene: they take one tree of hinges and slides with
/// springs, on a fixed base, that touches nothing and has no motors. Empty: they can.
std::string WhyNoPlainTree(const Scene& scene);

struct BenchOptions {
  std::string name;           // as tables call it
  std::string model_path;     // MJCF
  std::string controls_path;  // empty: none
  double time = 1;            // s
  double dt = 0;              // s; 0: the scene's
  int rounds = 5;
  int truth_substeps = 32;             // of the converged run, within dt; even
  std::vector<int> substeps{1, 2, 4};  // work against precision: steps within dt, from 1 on
  bool mujoco = true;
  std::vector<OutsidePeer> outside;
  bool phases = false;
  /// What takes the steps of StepFromSamePoses when it is run with one of "discrete" and "implicitfast"
  /// behind it; its instructions are counted. Empty: none are.
  std::vector<std::string> step_command;
  std::function<void(double)> progress;  // called with the share done
};

/// What a part of a step takes; nothing where it was not measured.
struct PhaseCost {
  std::string phase;
  std::optional<double> instructions;  // a step, mean
  /// Over all steps; each counts with its median over the rounds. Means add up to a step, as a part that few
  /// steps have shows in them alone.
  std::optional<double> median_us, mean_us;
};

struct PeerInstructions {
  std::string simulator;  // as in the rows
  double per_step = 0;
};

struct BenchScene {
  std::string name;
  Integrator integrator =
      Integrator::kEuler;     // of "fork1s": what the scene chooses; beside it by the other rule
  std::vector<PeerRow> rows;  // fork1s at dt first; as of MeasurePeers
  std::vector<PeerInstructions> instructions;
  std::vector<PhaseCost> phases;
  std::string why_no_instructions;  // a sentence, where they were asked for

  /// The row of a simulator at the first row's step; none: it did not take part.
  const PeerRow* At(const std::string& simulator) const;
  std::optional<double> Instructions(const std::string& simulator) const;
  /// How far the truth is from itself at twice its step: what errors below that are worth.
  double TruthErrorPercent() const { return rows.empty() ? 0 : rows.back().error_percent; }
};

/// Errors: as of MeasurePeers; kFormat for controls that cannot be read.
Expected<BenchScene> MeasureBench(const BenchOptions& options);

/// Many simulations of one scene, stepped by a pool of threads.
struct ManyCost {
  std::string scene;
  int instances = 0, threads = 1;
  double step_us = 0;  // of one instance: wall time over steps of all
};
Expected<std::vector<ManyCost>> MeasureMany(const BenchOptions& scene, int instances);

/// The largest stable steps of a scene, its stiffness times 1, 10, 100 and 1000.
struct BenchStability {
  std::string scene;
  std::vector<StabilityRow> rows;
};
Expected<BenchStability> MeasureBenchStability(const BenchOptions& scene);

/// All that a run of the command measured.
struct BenchResults {
  std::string when, machine;  // for the page
  std::vector<BenchScene> scenes;
  std::vector<ManyCost> many;
  std::vector<BenchStability> stability;
};

/// bench.csv, bench_phases.csv, bench_many.csv, bench_stability.csv, those that have rows, bench_precision.svg
/// and bench_stability.svg, and bench.html, which holds all of it. The folder is made if need be. Errors:
/// kFile.
Expected<void> WriteBench(const BenchResults& results, const std::string& folder);

}  // namespace fork1s
