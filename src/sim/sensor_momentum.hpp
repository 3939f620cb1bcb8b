// Momentum of the bodies of a scene.
#pragma once

#include <fork1s/mechanism/scene.hpp>

namespace fork1s::internal {

struct Momentum {
  double mass = 0;
  Vector3 center_W = Vector3::Zero();      // m, centre of mass
  Vector3 linear = Vector3::Zero();        // N·s, world axes
  Vector3 about_center = Vector3::Zero();  // N·m·s, world axes

  Vector3 AboutOrigin() const { return about_center + center_W.cross(linear); }
};

/// `V_W`: [ω; velocity of the body's origin], world axes.
inline Momentum MomentumOf(const SpatialInertia& inertia, const RigidTransform& X_WB, const Vector6& V_W) {
  const Matrix3& R = X_WB.rotation();
  const Vector3 omega = V_W.head<3>(), arm = R * inertia.center;
  Momentum m;
  m.mass = inertia.mass;
  m.center_W = X_WB.translation() + arm;
  m.linear = inertia.mass * (V_W.tail<3>() + omega.cross(arm));
  m.about_center = R * (inertia.rotational * (R.transpose() * omega));
  return m;
}

/// Of a body that is not the world.
inline const SpatialInertia& InertiaOf(const Scene& scene, const SensorBody& b) {
  if (b.mechanism < 0) return scene.free_bodies[static_cast<std::size_t>(b.free_body)].inertia;
  return scene.mechanisms[static_cast<std::size_t>(b.mechanism)].bodies[b.body.u()].inertia;
}
inline double GravityCompensationOf(const Scene& scene, const SensorBody& b) {
  if (b.mechanism < 0) return scene.free_bodies[static_cast<std::size_t>(b.free_body)].gravity_compensation;
  return scene.mechanisms[static_cast<std::size_t>(b.mechanism)].bodies[b.body.u()].gravity_compensation;
}

}  // namespace fork1s::internal
