// Questions about a simulation that need nothing of its insides: names, contacts in newtons, rays.
#pragma once

#include <fork1s/collision/ray_world.hpp>
#include <fork1s/sim/simulation.hpp>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace fork1s {

/// Place in Simulation::bodies(). Errors: kUsage, with the names that there are.
Expected<int> BodyNamed(const Simulation& simulation, const std::string& name);
/// Place in Simulation::control_names(). Errors: likewise.
Expected<int> ControlNamed(const Simulation& simulation, const std::string& name);
/// Sets a control by name, moved into its limits. Errors: kUsage, for unknown names and values that are not
/// finite.
Expected<void> TrySetControl(Simulation& simulation, const std::string& name, double value);

/// A contact that bears force, world axes.
struct BodyContact {
  int body_a = -1, body_b = -1;        // places in Simulation::bodies(), a before b; -1: the still world
  std::string name_a, name_b;          // "world" for the still world
  Vector3 point_W = Vector3::Zero();   // m
  Vector3 normal_W = Vector3::Zero();  // from a to b
  Vector3 force_W = Vector3::Zero();   // N, on b, the mean of the last step; adhesion's compression included
  Vector3 moment_W = Vector3::Zero();  // N·m about the point, on b: torsional and rolling friction
  double gap = 0;                      // m, negative in penetration, as the step found it
  double friction = 0;
  Vector3 pull_W = Vector3::Zero();  // N, on b, of adhesion; force_W bears the compression by it
};

/// Those of the last step, frozen ones included.
std::vector<BodyContact> Contacts(const Simulation& simulation);

/// What a ray of RayCaster meets.
struct BodyHit {
  int body = -1;        // place in Simulation::bodies(); -1: the still world
  std::string name;     // "world" for the still world
  double distance = 0;  // m
  Vector3 point_W = Vector3::Zero(), normal_W = Vector3::Zero();
};

/// Casts rays into simulations of one scene: all bodies are seen, those that do not touch too. Made once, it
/// follows the poses of whichever simulation it is asked about.
class RayCaster {
 public:
  /// Errors: kModel, for shapes that make no sense.
  static Expected<RayCaster> Create(const Simulation& simulation);
  /// The first body along `direction` from `origin`, no farther than `reach` [m]; see RayWorld::Cast.
  std::optional<BodyHit> Cast(const Simulation& simulation, const Vector3& origin, const Vector3& direction,
                              double reach = std::numeric_limits<double>::infinity());

 private:
  explicit RayCaster(RayWorld world) : world_(std::move(world)) {}
  RayWorld world_;
};

}  // namespace fork1s
