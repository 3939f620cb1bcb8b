// Controls that are samples of a path, one for several steps.
#pragma once

#include <fork1s/sim/simulation.hpp>

namespace fork1s {

/// Moves all controls, coordinates of driven bases included, linearly over `steps` steps, from where the last
/// step left them to those set when this is made. Controls that are set between two of these steps are where
/// it moves to from then on.
///
///     simulation.SetControls(path(simulation.time() + 4 * simulation.dt()));
///     ControlMove move(simulation, 4);
///     for (int i = 0; i < 4; ++i) StepReport report = move.Step(simulation);
class ControlMove {
 public:
  /// Throws std::invalid_argument for less than one step. Rates of driven bases that are set are those of the
  /// end.
  ControlMove(const Simulation& simulation, int steps);
  /// The next of these steps; a single one is Simulation::Step(true). Throws std::invalid_argument after the
  /// last.
  StepReport Step(Simulation& simulation);

 private:
  VectorX target_, set_;  // at the end; as this left them
  VectorX base_rates_;    // at the end, NaN: not known
  int steps_left_;
};

}  // namespace fork1s
