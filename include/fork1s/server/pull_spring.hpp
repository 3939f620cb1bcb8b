// A spring between a point of any body and the pointer of a viewer.
#pragma once

#include <fork1s/server/wire.hpp>
#include <fork1s/sim/simulation.hpp>

namespace fork1s {

/// Force [N] of a spring k and a damper c from a point of `body` to `target_W`, for the next step. The spring
/// is taken implicitly: with p_free and v_free where the step would carry the point without the pull, W what
/// the point gives way per impulse (springs and dampers of the mechanism included) and C what the interior
/// gives way per force at once,
///     F = k (target - p⁺) - c v⁺,   p⁺ = p_free + (h² W + C) F,   v⁺ = v_free + h W F,
/// so that no stiffness makes a light fingertip ring. Contact is left to the step itself.
Vector3 PullForce(const Simulation& simulation, int body, const Vector3& point_B, const Vector3& target_W,
                  double stiffness);

/// A stiffness at which a pull over a tenth of the model's size weighs about twice what the model weighs
/// [N/m].
double SuggestPullStiffness(const Simulation& simulation);

/// Half the diagonal of the box around all moving bodies' shapes [m].
double SceneRadius(const Simulation& simulation);

}  // namespace fork1s
