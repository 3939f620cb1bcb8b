// Tendons through space (paths.cpp).
#pragma once

#include <fork1s/mechanism/kinematics.hpp>

namespace fork1s::internal {

/// Length and arms of a path by q and the poses and screws of `kinematics`; `out` has the path's coordinates.
void ComputePath(const Mechanism& mechanism, const Mechanism::Path& path, const Kinematics& kinematics,
                 const VectorX& q, PathState& out);
/// Fills the coordinates of path `index` of the definition; joints are there.
void FindCoordinates(const Mechanism& mechanism, int index, Mechanism::Path& path);
/// The same for a path of angular velocities.
void FindRateCoordinates(const Mechanism& mechanism, Mechanism::Path& path);
/// ErrorCode::kModel where an element is not finite, out of place or on no body.
Expected<void> CheckPath(const MechanismDef& def, const PathDef& path);

}  // namespace fork1s::internal
