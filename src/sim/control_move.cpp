#include <cmath>
#include <fork1s/sim/control_move.hpp>

namespace fork1s {

ControlMove::ControlMove(const Simulation& simulation, int steps)
    : target_(simulation.controls()),
      set_(simulation.controls()),
      base_rates_(simulation.base_rates()),
      steps_left_(steps) {
  FORK1S_REQUIRE(steps > 0, "over", steps, "steps; give 1 or more");
}

StepReport ControlMove::Step(Simulation& simulation) {
  FORK1S_REQUIRE(steps_left_ > 0 && simulation.controls().size() == set_.size(), steps_left_);
  const VectorX& start = simulation.start_controls();
  const auto first_of_bases = static_cast<int>(set_.size() - base_rates_.size());
  for (int k = 0; k < set_.size(); ++k) {
    if (simulation.controls()(k) != set_(k)) target_(k) = simulation.controls()(k);
    const double next = steps_left_ == 1 ? target_(k) : start(k) + (target_(k) - start(k)) / steps_left_;
    // An initial value may lie outside the limits to which a new value is moved.
    if (next != simulation.controls()(k)) simulation.SetControl(k, next);
    if (k < first_of_bases) continue;
    const double rate = base_rates_(k - first_of_bases);
    if (steps_left_ > 1)
      simulation.SetControl(k, next);  // its rate is not that of the end
    else if (!std::isnan(rate))
      simulation.SetBaseRate(k, rate);
  }
  set_ = simulation.controls();
  --steps_left_;
  return simulation.Step(true);
}

}  // namespace fork1s
