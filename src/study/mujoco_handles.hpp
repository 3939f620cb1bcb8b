// MuJoCo's models and data with owners.
#pragma once

#include <mujoco/mujoco.h>

#include <fork1s/spatial/rigid_transform.hpp>
#include <memory>

namespace fork1s::internal {

struct MuJoCoDeleter {
  void operator()(mjModel* m) const { mj_deleteModel(m); }
  void operator()(mjData* d) const { mj_deleteData(d); }
};
using MuJoCoModelPointer = std::unique_ptr<mjModel, MuJoCoDeleter>;
using MuJoCoDataPointer = std::unique_ptr<mjData, MuJoCoDeleter>;

inline RigidTransform PoseOf(const mjData* d, int body) {
  const double* q = d->xquat + 4 * body;
  return {Quaternion(q[0], q[1], q[2], q[3]), Vector3(Eigen::Map<const Vector3>(d->xpos + 3 * body))};
}

}  // namespace fork1s::internal
