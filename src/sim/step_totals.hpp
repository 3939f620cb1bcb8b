// Several steps as one call: what all of them were like, and the loads that act through all of them.
#pragma once

#include <cstdint>
#include <fork1s/sim/control_move.hpp>
#include <fork1s/sim/run_statistics.hpp>
#include <optional>
#include <string>

namespace fork1s::internal {

struct StepTotals {
  int steps = 0;  // that were made: fewer than asked for where one was not finite
  int contacts = 0, limits = 0, forces_at_bound = 0;  // in the last step
  double max_penetration = 0;                         // m, in any step
  double residual = 0;                                // of the contact solver, the worst
  int unconverged = 0;                                // steps
  int halved = 0;                                     // steps, two-stage
  std::int64_t stages = 0, stage_iterations = 0;      // two-stage
  int max_newton_iterations = 0;                      // of a stage
  double stage_residual = 0;                          // m, the worst
  std::string halved_by, stage_residual_of;           // names; empty: none
  int refreshes = 0, failed_refreshes = 0;
  int expansions = 0, expanded_steps = 0;
  RelinearizationTotals refreshes_by_cause;
  bool contacts_dropped = false;
  bool finite = true;

  double mean_newton_iterations() const {
    return stages > 0 ? static_cast<double>(stage_iterations) / static_cast<double>(stages) : 0;
  }
  void Add(const StepReport& step, const World& world);
};

/// A wrench on a point of a body through all steps of a call.
struct BodyPush {
  int body = 0;
  Vector3 force_W, moment_W;  // N, N·m
  Vector3 point_B;            // m
};

/// Makes `steps` steps, or fewer where one is not finite. Controls jump, or move over all of the steps.
/// `apply_loads(i)` is called before step i.
template <class ApplyLoads>
StepTotals RunSteps(Simulation& simulation, int steps, bool move, const ApplyLoads& apply_loads) {
  StepTotals totals;
  std::optional<ControlMove> controls;
  if (move && steps > 0) controls.emplace(simulation, steps);
  for (int i = 0; i < steps && totals.finite; ++i) {
    apply_loads(i);
    totals.Add(controls ? controls->Step(simulation) : simulation.Step(), simulation.world());
  }
  return totals;
}

}  // namespace fork1s::internal
