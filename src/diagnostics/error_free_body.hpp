// A free body's motion at three nodes.
#pragma once

#include <fork1s/stepping/free_body.hpp>

#include "error_companion.hpp"

namespace fork1s {

struct FreeBodyPath {
  explicit FreeBodyPath(const FreeBody& b) {
    for (int i = 0; i < 3; ++i) {
      X[i] = RigidTransform(b.pose().rotation(), b.center_W());
      v[i] << b.omega_W(), b.velocity_of_center();
    }
    v_earlier_before = v_earlier = v[0];
  }
  void End(const FreeBody& b, double h) {
    v_earlier_before = v_earlier;
    v_earlier = v[0];
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
  // d[angular momentum; momentum]/dt at the node by centred differences and the past steps, right to h^3, as in
  // ErrorCompanion::CorrectCentred; in world axes the logarithm lacks h^2/12 of the bracket.
  Vector6 MomentumRate(const SpatialInertia& I, double h) const {
    const RateDerivatives<Vector6> d(v_earlier_before, v_earlier, v[0], v[1], v[2], h);
    const Vector6 mean = 0.5 * (v[1] + v[2]), change = (v[2] - v[1]) / h;
    const double h2 = h * h;
    const Vector3 w = mean.head<3>();
    const Vector3 omega = w - h2 / 6 * d.second.head<3>() + h2 / 12 * w.cross(Vector3(change.head<3>()));
    const Vector3 alpha =
        change.head<3>() - h2 / 12 * d.third.head<3>() + h2 / 12 * w.cross(Vector3(d.second.head<3>()));
    const Matrix3& R = X[1].rotation();
    const Matrix3 I_W = R * I.rotational * R.transpose();
    Vector6 rate;
    rate << I_W * alpha + omega.cross(Vector3(I_W * omega)), I.mass * (change - h2 / 12 * d.third).tail<3>();
    return rate;
  }
  RigidTransform X[3];  // axes of the body at its centre of mass
  Vector6 v[3];         // [ω; velocity of the centre], as in ErrorCompanion
  // In the step before that of v[0], and in the one before.
  Vector6 v_earlier = Vector6::Zero(), v_earlier_before = Vector6::Zero();
  Vector6 applied = Vector6::Zero();                     // of the coming step, without contacts, as load
  Vector6 load[2] = {Vector6::Zero(), Vector6::Zero()};  // [moment about the world's origin; force]
};

}  // namespace fork1s
