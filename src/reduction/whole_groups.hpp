// Groups of joints of which the reduced model left nothing out.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>
#include <vector>

namespace fork1s {

/// Per coordinate [n]: whether the reduced model has all motions of the joints that depend on each other with it,
/// and none of their forces bends with the pose. Then coordinates chosen again would be the same motions under
/// other names, and the model does not grow old as such a joint turns. Loops, springy closures, tendons
/// through space and springs that are not linear bend; and rotation vectors, what joints of several freedoms
/// turn by, end at a full turn.
std::vector<char> FindWhole(const ReducedModel& model);

}  // namespace fork1s
