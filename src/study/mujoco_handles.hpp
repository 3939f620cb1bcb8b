// MuJoCo's models and data with owners, and what it complains through.
#pragma once

#include <mujoco/mujoco.h>

#include <fork1s/spatial/rigid_transform.hpp>
#include <memory>
#include <mutex>
#include <stdexcept>

namespace fork1s::internal {

struct MuJoCoDeleter {
  void operator()(mjModel* m) const { mj_deleteModel(m); }
  void operator()(mjData* d) const { mj_deleteData(d); }
};
using MuJoCoModelPointer = std::unique_ptr<mjModel, MuJoCoDeleter>;
using MuJoCoDataPointer = std::unique_ptr<mjData, MuJoCoDeleter>;

/// While it lives MuJoCo's errors are std::runtime_error and its warnings are silent, but counted in mjData.
/// MuJoCo complains through global function pointers, so that one run goes at a time.
class MuJoCoHandlers {
 public:
  MuJoCoHandlers() : lock_(mutex_), error_(mju_user_error), warning_(mju_user_warning) {
    mju_user_error = [](const char* message) { throw std::runtime_error(message); };
    mju_user_warning = [](const char*) {};
  }
  ~MuJoCoHandlers() {
    mju_user_error = error_;
    mju_user_warning = warning_;
  }
  MuJoCoHandlers(const MuJoCoHandlers&) = delete;
  MuJoCoHandlers& operator=(const MuJoCoHandlers&) = delete;

 private:
  static inline std::mutex mutex_;
  std::lock_guard<std::mutex> lock_;
  void (*error_)(const char*);
  void (*warning_)(const char*);
};

inline RigidTransform PoseOf(const mjData* d, int body) {
  const double* q = d->xquat + 4 * body;
  return {Quaternion(q[0], q[1], q[2], q[3]), Vector3(Eigen::Map<const Vector3>(d->xpos + 3 * body))};
}

}  // namespace fork1s::internal
