// What a viewer can change about the model while it runs.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <string>
#include <vector>

namespace fork1s {

/// Joints whose stiffness is scaled together: the trunk from the base to where the mechanism first branches,
/// then every branch.
struct JointGroup {
  std::string name;
  int mechanism = 0;
  std::vector<int> joints;  // of the mechanism
  double scale = 1;
};
std::vector<JointGroup> FindJointGroups(const std::vector<MechanismDef>& mechanisms);

struct LiveSettings {
  double dt = 1.0 / 60;                    // s
  Vector3 gravity = Vector3(0, 0, -9.81);  // m/s²
  double damping_scale = 1;
  double friction_scale = 1;
  int modes = -1;  // of every mechanism; negative: each its own
  int detail = 0;  // 0: the interfaces given; 1: their parents too; 2: every body
  Recovery recovery = Recovery::kExact;
  double pull_stiffness = 100;  // N/m
  double speed = 1;             // simulated s per s
  std::vector<JointGroup> groups;
  std::vector<std::vector<std::string>>
      interfaces;  // per mechanism: bodies picked by hand; empty: the model's
};

/// The scene with the settings worked in: scaled springs, dampers and friction, modes, interface bodies.
Scene ApplySettings(Scene scene, const LiveSettings& settings);

/// Sets one number by its name on the wire: "dt", "gravity" (along z), "damping", "friction", "modes",
/// "detail", "recovery" (0 exact, 1 twist), "pull_stiffness", "speed", "stiffness" [group]. Returns whether
/// the reduced model must be built again. Errors (kUsage) name the setting and its range.
Expected<bool> ChangeSetting(const std::string& name, int index, double value, LiveSettings& settings);

}  // namespace fork1s
