// A step in full coordinates: Newton on motion and contact together.
#include <algorithm>
#include <cmath>
#include <limits>

#include "simulation_detail.hpp"

namespace fork1s {

using internal::FullFreeBody;
using internal::FullMechanism;

FullStepReport FullSimulation::Detail::Step() {
  PassControls();
  return StepByStages();
}

// The stiffness that loads leave speeds Newton up, but where it is negative, near buckling, it can lead
// astray.
bool FullSimulation::Detail::Solve(const std::function<bool()>& begin, FullStepReport& report) {
  bool finite = false;
  for (bool stiffening : {true, false}) {
    if (!stiffening) contact_set.ClearImpulses();
    finite = begin() && Iterate(stiffening, report);
    if (finite && (report.converged || report.residual < 1e-6)) break;
  }
  return finite;
}

bool FullSimulation::Detail::Iterate(bool stiffening, FullStepReport& report) {
  report.converged = false;
  // Contacts that share a load in more than one way let the last digits wander: no progress ends it as well.
  constexpr int kPatience = 12;
  double best = std::numeric_limits<double>::infinity();
  int best_at = 0;
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    ++report.iterations;
    for (std::size_t i = 0; i < mechanisms.size(); ++i)
      if (!mechanisms[i].Linearise(contact_set.OnBodies(i, mechanisms[i]), stiffening)) return false;
    if (!contact_set.Solve(mechanisms, free_bodies, options.contact, report.solver)) return false;
    report.residual = 0;
    double relative = 0;
    for (std::size_t i = 0; i < mechanisms.size(); ++i) {
      mechanisms[i].pushed = contact_set.PushesMechanism(i);
      const double change = mechanisms[i].Accept(contact_set.unknowns(i));
      if (!mechanisms[i].NextIsFinite()) return false;
      report.residual = std::max(report.residual, change);
      relative = std::max(relative, change / mechanisms[i].mechanism().length_scale());
    }
    for (std::size_t i = 0; i < free_bodies.size(); ++i) {
      free_bodies[i].pushed = contact_set.PushesFreeBody(i);
      const double change = free_bodies[i].Accept(contact_set.free_port_twist(i));
      if (!free_bodies[i].NextIsFinite()) return false;
      report.residual = std::max(report.residual, change);
      relative = std::max(relative, change);
    }
    // One more iteration than the tolerance asks for: the poses of the last one are then those of its forces.
    if (relative <= options.tolerance && iteration > 0) {
      // Where many contacts share a load rounding may keep the residual above the tolerance of one solve.
      report.converged = report.solver.residual <= 100 * options.contact.tolerance;
      break;
    }
    if (relative < 0.5 * best) {
      best = relative;
      best_at = iteration;
    }
    if (iteration - best_at > kPatience) break;
  }
  return true;
}

}  // namespace fork1s
