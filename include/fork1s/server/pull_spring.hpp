// A spring between a point of any body and the pointer of a viewer.
#pragma once

#include <fork1s/server/wire.hpp>
#include <fork1s/sim/simulation.hpp>

namespace fork1s {

/// Force [N] of a spring k and a critical damper from a point of `body` to `target_W`, for the next step. The
/// spring is taken implicitly: with W what the point gives way per impulse and C per force at once,
///     p⁺ = p + h v + h² W F + C (F - F_last),   F = k (target - p⁺) - c v⁺,   v⁺ = v + h W F,
/// so that no stiffness makes a light fingertip ring. `last_force_W` is the spring's force of the step
/// before.
Vector3 PullForce(const Simulation& simulation, int body, const Vector3& point_B, const Vector3& target_W,
                  double stiffness, const Vector3& last_force_W);

/// A stiffness at which a pull over a tenth of the model's size weighs about twice what the model weighs
/// [N/m].
double SuggestPullStiffness(const Simulation& simulation);

/// Half the diagonal of the box around all moving bodies' shapes [m].
double SceneRadius(const Simulation& simulation);

}  // namespace fork1s
