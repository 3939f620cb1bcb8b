// The error figure of a run: the largest error estimates of all its steps, by body.
#pragma once

#include <fork1s/sim/error_estimate.hpp>
#include <fork1s/sim/simulation.hpp>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace fork1s::internal {

/// to - from [m], or 0 where that is within rounding of the two positions: what turns about its origin moves by that.
Vector3 WayBeyondRounding(const Vector3& from, const Vector3& to);

class ErrorFigure {
 public:
  /// Of bodies of one name, the largest.
  struct Body {
    std::string name;
    double total = 0, interior = 0, time = 0;  // m, largest of all steps; infinite after a failure
    double last = 0;                           // m, at the end of the last step
    double motion = 0;                         // m, largest distance from the start
    double angle = 0, angle_last = 0;          // rad, of orientation: largest of all steps, and last
  };
  /// Of all bodies [m].
  struct Largest {
    double total = 0, interior = 0, time = 0, motion = 0;
    double angle = 0;  // rad
    bool finite = true;
    /// Whether the error is small enough beside the motion that it shrinks by the order of the step.
    bool IsWithinRange() const { return finite && 100 * total <= kMaxPercent * motion; }
  };
  // Larger errors need not shrink by the order of the step, which the extrapolation assumes.
  static constexpr double kMaxPercent = 10;  // of the motion

  /// Before Simulation::Step: makes the simulations beside this one where there are none.
  void BeginStep(const Simulation& simulation);
  void EndStep(const Simulation& simulation, const StepReport& report);
  /// The simulation was built again: the largest errors stay, and the error at this moment is taken as 0. `where`
  /// completes "the error estimate began again", for Warnings.
  void Restart(const std::string& where);

  /// The simulation is at a state of which no errors are known: forgets all. `where`: as of Restart.
  void Reset(const std::string& where);

  const std::vector<Body>& bodies() const { return values_.bodies; }
  Largest largest() const;
  /// Sentences where the figure means nothing, or less than it says.
  std::vector<std::string> Warnings() const;

 private:
  struct Values {
    std::vector<Body> bodies;
    std::set<std::string> began_anew;  // where
    bool failed = false;
    std::string refused;  // why there is no estimate
  };

 public:
  /// A moment to come back to; it outlives the figure.
  struct Snapshot {
    Values values;
    std::shared_ptr<const ErrorEstimate::Snapshot> estimate;  // null before the first step
  };
  Snapshot Save() const;
  /// After Simulation::Restore of the moment that the snapshot was taken at.
  void Restore(const Simulation& simulation, const Snapshot& snapshot);

 private:
  void UpdateLargest();

  Values values_;
  std::optional<ErrorEstimate> estimate_;
};

}  // namespace fork1s::internal
