// What the command line warns of at the end of a run, and steps that were undone, for other programs that step.
#pragma once

#include <fork1s/sim/sanity_monitor.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sim/interpenetration.hpp"

namespace fork1s::internal {

/// Monitors steps for implausible motion (SanityMonitor) and for bodies that pass through others because they are no
/// interface (InterpenetrationMonitor). A step costs a pass of collision detection more.
class RunWatch {
 public:
  explicit RunWatch(const Simulation& simulation);
  /// After a step that was not undone.
  void Update(const Simulation& simulation, const SanityMonitor::Seen& seen);
  /// After a change of detail or stiffness. What was seen before stays.
  void Changed(const Simulation& simulation);
  /// After one that was undone.
  void NoteUndone(const Simulation& simulation, const StepReport& report);
  /// A sentence for each kind that was implausible, the steps that were undone first.
  std::vector<std::string> Implausible() const;
  /// Of each level of detail, deepest first.
  std::vector<Interpenetration> Passed() const;

 private:
  void WatchInterior(const Simulation& simulation);

  int undone_ = 0;            // steps
  std::string undone_first_;  // when and what
  SanityMonitor monitor_;
  std::optional<InterpenetrationMonitor> interior_;
  std::vector<Interpenetration> passed_;  // before the last change
};

}  // namespace fork1s::internal
