// What a viewer can change about the model while it runs.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <string>
#include <vector>

#include "server/tunables.hpp"

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
  DetailLevel detail = DetailLevel::kInterface;
  Recovery recovery = Recovery::kExact;
  double pull_stiffness = 100;  // N/m
  double speed = 1;             // simulated s per s
  bool signals = false;         // every frame tells all signals
  bool error = false;           // the error is estimated
  double accuracy = 0;          // m that the estimate is to stay below; 0: dt and modes stay as they are
  std::vector<JointGroup> groups;
  std::vector<ServoShare> servos;
  std::vector<Tunable> tunables;
  std::vector<std::vector<std::string>>
      interfaces;  // per mechanism: bodies picked by hand; empty: the model's
};

/// The scene with the settings worked in: scaled springs, dampers and friction, picked interface bodies.
Scene ApplySettings(Scene scene, const LiveSettings& settings);

/// The servos of the scene as the settings scale them.
std::vector<ServoShare> ServosNow(const Scene& scene, const LiveSettings& settings);

/// What a setting asks for when it changes.
enum class SettingKind {
  kPlain,     ///< nothing but to hold it
  kFidelity,  ///< another level of detail of the same model
  kModel,     ///< another model
};

/// Sets one number by its name on the wire: "dt", "gravity" (along z), "damping", "friction", "modes",
/// "detail" (0 object, 1 interface, 2 parents, 3 all), "recovery" (0 exact, 1 twist, 2 curved, 3 expanded),
/// "pull_stiffness", "speed", "stiffness" [group], "tune" [tunable], "signals", "error" (0 or 1), "accuracy"
/// (m). Errors (kUsage) name the setting and its range.
Expected<SettingKind> ChangeSetting(const std::string& name, int index, double value, LiveSettings& settings);

}  // namespace fork1s
