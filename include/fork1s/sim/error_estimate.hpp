// How far a simulation is from the truth, estimated while it runs.
//
// Beside the simulation goes another by a quarter of the step, and, where the reduction leaves something out, a third by
// such steps with all modes, evaluated exactly. Their distances, extrapolated by the order of the scheme (Richardson),
// are the estimate: docs/method.md, section 8.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/base/types.hpp>
#include <memory>
#include <string>
#include <vector>

namespace fork1s {

class Simulation;
struct StepReport;

struct ErrorEstimateOptions {
  double window = 0.25;  // s: what is shown is the largest of this time, since errors swing
};

/// By how much a body is estimated to be off: displacements of its origin, truth minus simulation, and the rotation
/// from simulation to truth. A point at a distance r from the origin is off by up to shown + r shown_angle.
struct BodyError {
  std::string body;
  int mechanism = -1;                  // of world(); -1: a free body
  int index = 0;                       // body of the mechanism, or free body
  Vector3 interior = Vector3::Zero();  // m, world axes: of modes and of recovery
  Vector3 time = Vector3::Zero();      // m: of the time step
  double shown = 0;  // m, largest |interior + time| within the window; infinite after Failed()
  double shown_interior = 0, shown_time = 0;  // m, each part's own largest
  double motion = 0;                          // m, largest way from the start so far
  Vector3 interior_angle = Vector3::Zero();   // rad, rotation vector, world axes: as interior
  Vector3 time_angle = Vector3::Zero();       // rad, the same: as time
  double shown_angle =
      0;  // rad, largest |interior_angle + time_angle| within the window; infinite after Failed()
};

/// Follows a simulation from the state it is made at. For each step followed it takes four of a quarter of the length,
/// twice where the reduction leaves something out. A state set from outside, other detail or another step need a new estimate.
class ErrorEstimate {
 public:
  /// Errors are those of Simulation::Create and SetFidelity.
  static Expected<ErrorEstimate> Create(const Simulation& simulation,
                                        const ErrorEstimateOptions& options = {});
  ~ErrorEstimate();
  ErrorEstimate(ErrorEstimate&&) noexcept;
  ErrorEstimate& operator=(ErrorEstimate&&) noexcept;

  /// After every Simulation::Step of the same simulation. A step that was undone is not followed.
  void Follow(const Simulation& simulation, const StepReport& report);

  /// Of each mechanism its base, where that moves freely, and interface bodies; then free bodies. At the present pose.
  const std::vector<BodyError>& bodies() const;
  /// Whether a shorter step was undone: nothing is known from there on.
  bool Failed() const;

  /// A moment to come back to, with the simulations beside this one. It outlives the estimate.
  struct Snapshot;
  std::shared_ptr<const Snapshot> Save() const;
  /// Goes back to it where the simulation followed does. Errors leave everything as it was: kUsage for a snapshot of
  /// another scene, or of a simulation that left something else out.
  Expected<void> Restore(const Snapshot& snapshot);

 private:
  struct Detail;
  explicit ErrorEstimate(std::unique_ptr<Detail> detail);
  std::unique_ptr<Detail> detail_;
};

}  // namespace fork1s
