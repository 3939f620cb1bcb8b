// Lengths that springs and actuators act on: of joints, tendons and other transmissions.
#pragma once

#include <mujoco/mujoco.h>

#include <utility>
#include <vector>

namespace fork1s::internal {

/// A length about the reference pose: at_reference + Σ a q, with q counted from the reference.
struct Length {
  double at_reference = 0;
  std::vector<std::pair<int, double>> terms;  // degree of freedom (MuJoCo), a
  bool linear = true;  // false: a path through space, whose arms a are those of the reference pose
};

/// `data` at qpos0, with what mj_transmission computes. A path round geometry is the reader's own.
Length TendonLength(const mjModel& m, const mjData& d, int tendon);
Length ActuatorLength(const mjModel& m, const mjData& d, int actuator);  // gear included

bool IsSpatial(const mjModel& m, int tendon);
/// Whether a length hears a free joint: its arms there are of the world's axes and turn with the body.
bool HearsFreeJoint(const mjModel& m, const Length& length);
/// Bodies between which a tendon pulls, in the order of its path, repeated as it comes back to them.
std::vector<int> BodiesOfTendon(const mjModel& m, int tendon);

}  // namespace fork1s::internal
