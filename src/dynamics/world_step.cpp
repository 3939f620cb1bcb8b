#include <algorithm>
#include <cmath>
#include <fork1s/dynamics/world.hpp>

namespace fork1s {

StepReport World::Step(const StepOptions& options) {
  StepReport report;
  const double h = options.h;
  FORK1S_REQUIRE(h > 0 && std::isfinite(h), h);

  previous_.swap(contacts_);
  previous_speed_W_.swap(speed_W_);
  FindContacts(options, report);
  LayOutPorts(options);
  MatchPrevious();
  // Rows first: the curvature term compares them on the velocities of the start of the step.
  AssembleConstraints(options);
  for (MechanismDynamics& m : mechanisms_) m.Predict(h, options.gravity);
  for (FreeBody& b : free_bodies_) b.Predict(h, options.gravity);
  if (!points_.empty() || !limits_.empty()) {
    AssembleOperators();
    report.solver = solver_.Solve(blocks_, constraints_, limits_, velocities_, options.contact);
    ApplyImpulses();
  }

  report.finite =
      std::all_of(mechanisms_.begin(), mechanisms_.end(), [](const auto& m) { return m.IsFinite(); }) &&
      std::all_of(free_bodies_.begin(), free_bodies_.end(), [](const auto& b) { return b.IsFinite(); });
  if (!report.finite) {
    for (MechanismDynamics& m : mechanisms_) m.Revert();
    for (FreeBody& b : free_bodies_) b.Revert();
    contacts_.swap(previous_);
    speed_W_.swap(previous_speed_W_);
    return report;
  }
  KeepForNextStep(report);
  curvature_valid_ = true;
  for (MechanismDynamics& m : mechanisms_) {
    m.Integrate(h);
    if (options.refresh && m.Staleness() > 1) {
      if (m.Refresh()) {
        ++report.refreshes;
        curvature_valid_ = false;
      } else {
        ++report.failed_refreshes;
      }
    }
  }
  for (FreeBody& b : free_bodies_) b.Integrate(h);
  return report;
}

}  // namespace fork1s
