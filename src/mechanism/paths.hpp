// Tendons through space (paths.cpp).
#pragma once

#include <fork1s/mechanism/kinematics.hpp>
#include <vector>

namespace fork1s::internal {

/// Length and arms of a path by q and the poses and screws of `kinematics`; `out` has the path's coordinates.
void ComputePath(const Mechanism& mechanism, const Mechanism::Path& path, const Kinematics& kinematics,
                 const VectorX& q, PathState& out);
/// A straight part of a tendon at a pose; its length counts in that of the tendon by one over the divisor.
struct StraightPart {
  BodyIndex from_body, to_body;
  Vector3 from_R, to_R;  // m
  double divisor = 1;
};
/// The straight parts of a tendon; none for other paths. Ends on an obstacle are points of the obstacle's body.
void FindStraightParts(const Mechanism::Path& path, const Kinematics& kinematics,
                       std::vector<StraightPart>& out);
/// Fills the coordinates of path `index` of the definition; joints are there.
void FindCoordinates(const Mechanism& mechanism, int index, Mechanism::Path& path);
/// The same for a path of angular velocities.
void FindRateCoordinates(const Mechanism& mechanism, Mechanism::Path& path);
/// ErrorCode::kModel where an element is not finite, out of place or on no body.
Expected<void> CheckPath(const MechanismDef& def, const PathDef& path);

}  // namespace fork1s::internal
