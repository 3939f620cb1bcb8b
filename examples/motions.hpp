// What scene_motions writes: set-points by name, and the way from one to the next.
#pragma once

#include <algorithm>
#include <map>
#include <string>

namespace fork1s::examples {

using Row = std::map<std::string, double>;

/// 0 before a, 1 after b, with no jump of speed or acceleration.
inline double Ramp(double t, double a, double b) {
  const double s = std::clamp((t - a) / (b - a), 0.0, 1.0);
  return s * s * s * (10 + s * (6 * s - 15));
}

struct LegAngles {
  double yaw, hip, knee;
};

/// Set-points that put the foot of a leg of hexapod.xml at (x, y, z) from its hip, x outward in the
/// reference, z up. The femur reaches from (0.03, 0) to (0.1, 0.04), the tibia from there to the foot at
/// (0.12, -0.08).
LegAngles Reach(double x, double y, double z);

constexpr double kBeamWalkEnd = 14, kDigEnd = 20;  // s

/// Two machines with six legs walk up a step: scenes/beam_walkers.xml.
Row CarryBeam(double t);

/// Digs, lifts, swings and lets fall: scenes/excavator.xml.
Row Dig(double t);

}  // namespace fork1s::examples
