// The same motion in another scene: gains changed while it runs, bodies that come and go.
#pragma once

#include <fork1s/sim/simulation.hpp>

namespace fork1s {

/// The scene with a joint coordinate, named as in Simulation::CoordinateNames, or else a tendon or the servo of one, named
/// as its SpringDef, held by `stiffness` [N·m/rad or N/m]: see SetStiffness. Errors: kUsage for names that there are not, with those that there are, and for
/// values that are no stiffness.
Expected<Scene> WithStiffness(Scene scene, const std::string& coordinate, double stiffness);

/// A simulation of `scene` that goes on where `from` is. What has the same name in both keeps its state:
/// joint displacements and rates by the names of joints within mechanisms, poses and velocities of bases and
/// free bodies, set-points of controls; all else begins as `scene` has it. The detail and its options are
/// those of `from`.
///
///     auto softer = WithStiffness(simulation.scene(), "knee", 40);   // Expected<Scene>
///     softer->free_bodies.push_back(second_ball);
///     auto next = Continue(simulation, std::move(*softer));          // Expected<Simulation>
///
/// Contacts are found again. The time goes on, and controls of a base that was driven before count from where
/// they did, so set-points over time need no shift. Takes milliseconds.
/// Errors: as of Simulation::Create; `from` stays as it is.
Expected<Simulation> Continue(const Simulation& from, Scene scene);

}  // namespace fork1s
