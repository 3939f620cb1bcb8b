// Springs that pull points of bodies to targets, as a hand does: Simulation::SetPointSpring for whoever sets them by name.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <optional>
#include <vector>

namespace fork1s {

/// The spring of this stiffness [N/m] for the next step, critically damped for what it moves of `body`. Its
/// target goes from `target_start_W` to `target_W` within the step.
PointSpring PullSpring(const Simulation& simulation, int body, const Vector3& point_B,
                       const Vector3& target_start_W, const Vector3& target_W, double stiffness);

namespace internal {

/// Pulls the point of the body that is at `point_W` now (none: its origin) to a target that stays, until it is released.
/// Takes the place of another pull on the same mechanism or free body. damping [N s/m]; none: critical. Errors: kUsage
/// for a stiffness [N/m] that is not above 0, or a damping below 0.
Expected<void> Pull(int body, const std::optional<Vector3>& point_W, const Vector3& target_W,
                    double stiffness, std::optional<double> damping, Simulation& simulation);
/// Ends the pull on this body, if there is one.
void Release(int body, Simulation& simulation);

/// Springs that act, to be set again where SetFidelity or another simulation leaves them out.
std::vector<Simulation::BodyPointSpring> PointSprings(const Simulation& simulation);
void SetPointSprings(const std::vector<Simulation::BodyPointSpring>& springs, Simulation& simulation);

}  // namespace internal
}  // namespace fork1s
