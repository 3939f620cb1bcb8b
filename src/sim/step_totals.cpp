#include "sim/step_totals.hpp"

#include <algorithm>

namespace fork1s::internal {

void StepTotals::Add(const StepReport& step, const World& world) {
  contacts = step.contacts;
  limits = step.limits;
  forces_at_bound = step.forces_at_bound;
  max_penetration = std::max(max_penetration, step.max_penetration);
  residual = std::max(residual, step.solver.residual);
  unconverged += step.IsSolved() ? 0 : 1;
  stages += step.stages;
  stage_iterations += step.stage_iterations;
  max_newton_iterations = std::max(max_newton_iterations, step.max_stage_iterations);
  if (step.stage_residual > stage_residual) {
    stage_residual = step.stage_residual;
    stage_residual_of = world.NameOf(step.stage_residual_of);
  }
  if (step.halving != HalvingCause::kNone) {
    ++halved;
    halved_by = world.NameOf(step.halving_of);
  }
  refreshes += step.refreshes;
  AddRelinearizations(step, world, refreshes_by_cause);
  failed_refreshes += step.failed_refreshes;
  expansions += step.expansions;
  expanded_steps += step.by_expansion > 0 ? 1 : 0;
  contacts_dropped = contacts_dropped || step.contacts_dropped;
  finite = finite && step.finite;
  if (step.finite) ++steps;
}

}  // namespace fork1s::internal
