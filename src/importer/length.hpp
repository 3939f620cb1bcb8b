// Lengths that springs and actuators act on: of joints, tendons and other transmissions.
#pragma once

#include <mujoco/mujoco.h>

#include <utility>
#include <vector>

namespace fork1s::internal {

/// A length about the reference pose: at_reference + Σ a q, with q counted from the reference, or that of a
/// path times a gear: a tendon through space, a slider-crank, a force on a site.
struct Length {
  double at_reference = 0;
  std::vector<std::pair<int, double>> terms;  // degree of freedom (MuJoCo), a; of a path those that may
                                              // change it, with their arms at the reference
  int tendon = -1;                            // through space; -1: none
  int actuator = -1;                          // on sites or a ball joint, whose path is its own; -1: none
  int ball = -1;                              // joint, the angle that it has turned by; -1: none
  double gear = 1;                            // of the path

  bool has_path() const { return tendon >= 0 || actuator >= 0 || ball >= 0; }
  bool is_single() const { return !has_path() && terms.size() == 1; }
};

/// `data` at qpos0, with what mj_transmission computes.
Length TendonLength(const mjModel& m, const mjData& d, int tendon);
Length ActuatorLength(const mjModel& m, const mjData& d, int actuator);  // gear included

Length BallAngle(const mjModel& m, int joint);
/// Whether another joint of the body of a ball joint turns it too, so that its own angle is not that of the body.
bool IsBallOfSeveral(const mjModel& m, int joint);
/// rad, of a ball joint, where it comes to bear.
double BallLimit(const mjModel& m, int joint);

bool IsSpatial(const mjModel& m, int tendon);
/// Whether an actuator acts on a joint of this type.
inline bool IsOnJoint(const mjModel& m, int actuator, mjtJoint joint) {
  const int type = m.actuator_trntype[actuator];
  return (type == mjTRN_JOINT || type == mjTRN_JOINTINPARENT) &&
         m.jnt_type[m.actuator_trnid[2 * actuator]] == joint;
}
inline bool IsOnBall(const mjModel& m, int actuator) { return IsOnJoint(m, actuator, mjJNT_BALL); }
inline bool IsOnFreeJoint(const mjModel& m, int actuator) { return IsOnJoint(m, actuator, mjJNT_FREE); }
/// Bodies that carry the sites of an actuator on sites or of a slider-crank, or the free joint of one on such a
/// joint; none for others.
std::vector<int> BodiesOfActuator(const mjModel& m, int actuator);
/// Whether it is a wrench on a site without a reference, or on a free joint: its length is 0 at any pose.
inline bool HasNoLength(const mjModel& m, int actuator) {
  return IsOnFreeJoint(m, actuator) ||
         (m.actuator_trntype[actuator] == mjTRN_SITE && m.actuator_trnid[2 * actuator + 1] < 0);
}
/// Bodies between which a tendon pulls, in the order of its path, repeated as it comes back to them.
std::vector<int> BodiesOfTendon(const mjModel& m, int tendon);

}  // namespace fork1s::internal
