// Many copies of the demo's hand in one scene, each with its own box.
#pragma once

#include <cstdint>
#include <functional>

#include "hand_scenario.hpp"

namespace fork1s::examples {

/// `count` copies of a scene on a square grid, `spacing` [m] apart along x and y, the first where it was.
/// Names of all that moves get "#0", "#1", ... at their end; the still world is there once; the pairs that
/// never touch and the keyframes are those of every copy. Controls keep their order, copy after copy, except
/// those of driven bases, which follow all others.
Scene Replicate(const Scene& scene, int count, double spacing);

struct ManyHands {
  int count = 100;
  double spacing = 0.4;  // m; a hand with its box is 0.3 m wide
  HandScenario scenario;
};

struct ManyHandsMeasurement {
  int steps = 0;
  std::vector<double> step_us;
  double wall_s = 0;  // of all steps
  double simulated_s = 0;
  int contacts_max = 0;                               // that carry force
  int unconverged_closing = 0, unconverged_rest = 0;  // steps, before the rest and during it
  double penetration_max = 0;                         // m
  int held = 0;              // boxes that rose with their palm and hang in it at the end
  double drift_at_rest = 0;  // m, of any box against its palm over the rest
  bool finite = true;
  std::uint64_t hash = 0;  // of the final state
};

/// The scene with all its hands, open. Errors: those of loading and building it.
Expected<Simulation> CreateManyHands(const std::string& scene_path, const ManyHands& hands);

/// Runs the scenario on every hand at once; `after_step` is called after every step, outside the time
/// measured.
ManyHandsMeasurement RunManyHands(Simulation& simulation, const ManyHands& hands,
                                  const std::function<void(const StepReport&)>& after_step = {});

}  // namespace fork1s::examples
