// Steps that differ by less than a step is solved to.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>

namespace fork1s {

/// rad and m: what rounding leaves of the residual of a loop of some metres.
inline constexpr double kClosedToRounding = 1e-14;

/// While it lives, steps of a simulation are solved as far as rounding lets them: for derivatives by differences of
/// steps. A new world (SetFidelity) is not.
class SolvedToRounding {
 public:
  explicit SolvedToRounding(Simulation& simulation)
      : simulation_(simulation), newton_tolerance_(simulation.step_options().newton_tolerance) {
    simulation.step_options().newton_tolerance = 1e-15;
    SetClosingTolerance(kClosedToRounding);
  }
  ~SolvedToRounding() {
    simulation_.step_options().newton_tolerance = newton_tolerance_;
    SetClosingTolerance(kClosingTolerance);
  }
  SolvedToRounding(const SolvedToRounding&) = delete;
  SolvedToRounding& operator=(const SolvedToRounding&) = delete;

 private:
  void SetClosingTolerance(double tolerance) {
    for (MechanismDynamics& m : simulation_.world().mechanisms()) m.SetClosingTolerance(tolerance);
  }

  Simulation& simulation_;
  const double newton_tolerance_;
};

}  // namespace fork1s
