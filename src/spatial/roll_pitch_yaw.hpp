// The rotation of roll, pitch and yaw, the angles of URDF's <origin rpy> and of --base-pose.
#pragma once

#include <fork1s/spatial/rigid_transform.hpp>

namespace fork1s {

/// R = R_z(yaw) R_y(pitch) R_x(roll) of angles (roll, pitch, yaw) [rad]: about the fixed axes x, y and z, in this order.
inline Matrix3 RollPitchYawRotation(const Vector3& angles) {
  const Quaternion q = Eigen::AngleAxisd(angles[2], Vector3::UnitZ()) *
                       Eigen::AngleAxisd(angles[1], Vector3::UnitY()) *
                       Eigen::AngleAxisd(angles[0], Vector3::UnitX());
  return q.toRotationMatrix();
}

}  // namespace fork1s
