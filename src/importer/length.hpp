// Lengths that springs and actuators act on: of joints, tendons and other transmissions.
#pragma once

#include <mujoco/mujoco.h>

#include <utility>
#include <vector>

namespace fork1s::internal {

/// A length about the reference pose: at_reference + Σ a q, with q counted from the reference, or that of a
/// tendon through space times a gear.
struct Length {
  double at_reference = 0;
  std::vector<std::pair<int, double>> terms;  // degree of freedom (MuJoCo), a; of a tendon through space
                                              // those that may change it, with their arms at the reference
  int tendon = -1;     // through space; -1: none
  double gear = 1;     // of that
  bool linear = true;  // false: not a tendon, yet no sum: the arms a are those of the reference pose

  bool is_single() const { return tendon < 0 && terms.size() == 1; }
};

/// `data` at qpos0, with what mj_transmission computes.
Length TendonLength(const mjModel& m, const mjData& d, int tendon);
Length ActuatorLength(const mjModel& m, const mjData& d, int actuator);  // gear included

bool IsSpatial(const mjModel& m, int tendon);
/// Whether a length hears a free joint: its arms there are of the world's axes and turn with the body.
bool HearsFreeJoint(const mjModel& m, const Length& length);
/// Bodies between which a tendon pulls, in the order of its path, repeated as it comes back to them.
std::vector<int> BodiesOfTendon(const mjModel& m, int tendon);

}  // namespace fork1s::internal
