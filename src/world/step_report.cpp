#include "step_report.hpp"

#include <algorithm>

namespace fork1s {

void AddReport(const StepReport& part, StepReport& whole) {
  const StepReport before = whole;
  whole = part;
  whole.max_penetration = std::max(before.max_penetration, part.max_penetration);
  whole.refreshes += before.refreshes;
  whole.failed_refreshes += before.failed_refreshes;
  whole.contacts_dropped = before.contacts_dropped || part.contacts_dropped;
  whole.loop_residual = std::max(before.loop_residual, part.loop_residual);
  whole.parts = before.parts + part.parts;
  whole.stages += before.stages;
  whole.stage_iterations += before.stage_iterations;
  whole.max_stage_iterations = std::max(before.max_stage_iterations, part.max_stage_iterations);
  if (before.stage_residual > part.stage_residual) {
    whole.stage_residual = before.stage_residual;
    whole.stage_residual_of = before.stage_residual_of;
  }
  whole.impact = before.impact || part.impact;
  whole.stages_converged = before.stages_converged && part.stages_converged;
  MergeSolverReport(before.solver, whole.solver);
}

void MergeSolverReport(const ContactSolverReport& then, ContactSolverReport& solver) {
  solver.newton_iterations = std::max(solver.newton_iterations, then.newton_iterations);
  solver.fallback = std::max(solver.fallback, then.fallback);
  solver.residual = std::max(solver.residual, then.residual);
  solver.residual_impulse = std::max(solver.residual_impulse, then.residual_impulse);
  solver.residual_speed = std::max(solver.residual_speed, then.residual_speed);
  solver.active = std::max(solver.active, then.active);
  solver.sticking = std::max(solver.sticking, then.sticking);
  solver.sliding = std::max(solver.sliding, then.sliding);
  solver.converged = solver.converged && then.converged;
}

}  // namespace fork1s
