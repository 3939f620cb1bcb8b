// A spring between a point of any body and the pointer of a viewer.
#pragma once

#include <fork1s/sim/simulation.hpp>

#include "server/wire.hpp"
#include "sim/point_springs.hpp"

namespace fork1s {

/// A stiffness at which a pull over a tenth of the model's size weighs about twice what the model weighs
/// [N/m].
double SuggestPullStiffness(const Simulation& simulation);

/// Half the diagonal of the box around all moving bodies' shapes [m].
double SceneRadius(const Simulation& simulation);

}  // namespace fork1s
