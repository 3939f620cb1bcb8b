// The same motion in another scene: gains changed while it runs, bodies that come and go.
#pragma once

#include <fork1s/sim/simulation.hpp>

namespace fork1s {

/// A simulation of `scene` that goes on where `from` is. What has the same name in both keeps its state:
/// joint displacements and rates by the names of joints within mechanisms, poses and velocities of bases and
/// free bodies, set-points of controls; all else begins as `scene` has it. The detail and its options are
/// those of `from`.
///
///     Scene softer = simulation.scene();
///     softer.mechanisms[0] = SetStiffness(std::move(softer.mechanisms[0]), {knee, 0}, 40);
///     softer.free_bodies.push_back(second_ball);
///     auto next = Continue(simulation, std::move(softer));      // Expected<Simulation>
///
/// Contacts are found anew. The time goes on, and controls of a base that was driven before count from where
/// they did, so set-points over time need no shift. Takes milliseconds.
/// Errors: as of Simulation::Create; `from` stays as it is.
Expected<Simulation> Continue(const Simulation& from, Scene scene);

}  // namespace fork1s
