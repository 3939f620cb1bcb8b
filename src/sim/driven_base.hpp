// Controls that are coordinates of driven bases.
#pragma once

#include <fork1s/sim/simulation.hpp>

namespace fork1s::internal {

/// Whether a coordinate of a driven base, by its place among the controls, is one of its rotation vector [rad];
/// the others are lengths [m].
inline bool IsBaseRotation(const Simulation& simulation, int control) {
  const Eigen::Index first = simulation.controls().size() - simulation.num_base_coordinates();
  return control >= first && (control - first) % 6 >= 3;
}

}  // namespace fork1s::internal
