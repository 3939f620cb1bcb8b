// A spring and a damper between a point fixed in a body and a target in the world.
#pragma once

#include <fork1s/spatial/rigid_transform.hpp>

namespace fork1s {

/// The force k (target - x) - c ẋ acts at the point x of the body. Within a step the target moves linearly.
struct PointSpring {
  Vector3 point_B = Vector3::Zero();         // m, in the body
  Vector3 target_start_W = Vector3::Zero();  // m, at the start of the next step
  Vector3 target_W = Vector3::Zero();        // m, at its end and from then on
  double stiffness = 0;                      // N/m
  double damping = 0;                        // N s/m

  bool IsActive() const { return stiffness > 0 || damping > 0; }
  Vector3 SpringForce(const Vector3& point_W) const {
    return stiffness * (target_W - point_W);
  }                                                                      // N, without the damper
  Vector3 Force(const RigidTransform& X_WB, const Vector6& V_W) const {  // N; V_W about the body's origin
    const Vector3 arm_W = X_WB.rotation() * point_B;
    return SpringForce(X_WB * point_B) - damping * (V_W.tail<3>() + V_W.head<3>().cross(arm_W));
  }
  /// That force as a wrench about the world's origin.
  Vector6 Wrench(const RigidTransform& X_WB, const Vector6& V_W) const {
    const Vector3 force = Force(X_WB, V_W);
    Vector6 F;
    F << Vector3(X_WB * point_B).cross(force), force;
    return F;
  }
  /// b² k + b c [kg]: what it adds to the inertia of the point in an implicit stage of length b.
  double ImplicitMass(double b) const { return b * (b * stiffness + damping); }
  /// Of the part of the step between two shares of it.
  PointSpring Within(double share_start, double share_end) const {
    PointSpring out = *this;
    const Vector3 way = target_W - target_start_W;
    out.target_start_W = target_start_W + share_start * way;
    if (share_end < 1) out.target_W = target_start_W + share_end * way;
    return out;
  }
};

}  // namespace fork1s
