// A spring between a point of any body and the pointer of a viewer.
#pragma once

#include <fork1s/sim/simulation.hpp>

#include "server/wire.hpp"

namespace fork1s {

/// The spring of this stiffness [N/m] for the next step, critically damped for what it moves of `body`. Its
/// target goes from `target_start_W` to `target_W` within the step.
PointSpring PullSpring(const Simulation& simulation, int body, const Vector3& point_B,
                       const Vector3& target_start_W, const Vector3& target_W, double stiffness);

/// A stiffness at which a pull over a tenth of the model's size weighs about twice what the model weighs
/// [N/m].
double SuggestPullStiffness(const Simulation& simulation);

/// Half the diagonal of the box around all moving bodies' shapes [m].
double SceneRadius(const Simulation& simulation);

}  // namespace fork1s
