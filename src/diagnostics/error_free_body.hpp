// A free body's motion at three nodes.
#pragma once

#include <fork1s/stepping/free_body.hpp>

namespace fork1s {

struct FreeBodyPath {
  explicit FreeBodyPath(const FreeBody& b) {
    for (int i = 0; i < 3; ++i) {
      X[i] = RigidTransform(b.pose().rotation(), b.center_W());
      v[i] << b.omega_W(), b.velocity_of_center();
    }
  }
  void End(const FreeBody& b, double h) {
    for (int i = 0; i < 2; ++i) {
      X[i] = X[i + 1];
      v[i] = v[i + 1];
    }
    X[2] = RigidTransform(b.pose().rotation(), b.center_W());
    v[2] << LogRotation(X[2].rotation() * X[1].rotation().transpose()) / h,
        (X[2].translation() - X[1].translation()) / h;
  }
  // Angular momentum half way between nodes i and i + 1.
  Vector3 Spin(const SpatialInertia& I, int i, double h) const {
    const Vector3 omega = v[i].head<3>();
    const Matrix3 R = ExpRotation((i == 0 ? -0.5 : 0.5) * h * omega) * X[1].rotation();
    return R * (I.rotational * (R.transpose() * omega));
  }
  RigidTransform X[3];                                   // axes of the body at its centre of mass
  Vector6 v[3];                                          // [ω; velocity of the centre], as in ErrorCompanion
  Vector6 applied = Vector6::Zero();                     // of the coming step, without contacts, as load
  Vector6 load[2] = {Vector6::Zero(), Vector6::Zero()};  // [moment about the world's origin; force]
};

}  // namespace fork1s
