// The bob of cases.hpp in joint coordinates z = (r, θ): stages are the same, momenta stay in world axes, and
// base points x̂ are combined in z. It tells what a scheme owes to Cartesian base points.
#pragma once

#include <vector>

#include "cases.hpp"
#include "schemes.hpp"

namespace fork1s::lab {

struct PolarRun {
  std::vector<Vector2> positions;  // at each step
  double energy_left = 0;          // share of the swing energy
  double energy_gain = 0;
  double iterations_per_stage = 0;
};

PolarRun SimulatePolarBob(double stiffness, double amplitude, Scheme scheme, double h, int steps);

}  // namespace fork1s::lab
