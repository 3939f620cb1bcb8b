// Scenes and measures for the dynamics tests.
#pragma once

#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <fork1s/world/world.hpp>
#include <mechanisms.hpp>

namespace fork1s::testing {

inline World MustCreate(const Scene& scene, const World::Options& options = {}) {
  auto world = World::Create(scene, options);
  if (!world) throw std::runtime_error(world.error().Text());
  return std::move(*world);
}

inline World MustCreate(const MechanismDef& mechanism, const World::Options& options = {}) {
  Scene scene;
  scene.mechanisms.push_back(mechanism);
  return MustCreate(scene, options);
}

/// A scene whose only keyframe puts its one mechanism at q, q̇ and base twist V_R.
inline Scene Started(const MechanismDef& mechanism, const VectorX& q, const VectorX& q_dot,
                     const Vector6& V_R = Vector6::Zero()) {
  Scene scene;
  scene.mechanisms.push_back(mechanism);
  KeyframeDef key;
  key.mechanisms.push_back({q, q_dot, mechanism.X_WR, V_R, {}});
  scene.keyframes.push_back(key);
  return scene;
}

inline World MustStart(const MechanismDef& mechanism, const VectorX& q, const VectorX& q_dot,
                       const Vector6& V_R = Vector6::Zero(), World::Options options = {}) {
  options.initial_keyframe = 0;
  return MustCreate(Started(mechanism, q, q_dot, V_R), options);
}

/// Of a world whose interfaces Reduce may add to.
inline World::Options SteppedBy(Recovery recovery) {
  World::Options options;
  options.recovery = recovery;
  options.reduction.promote_hidden = true;
  return options;
}

/// How far the bodies of the first mechanism of one world are from those of the other [m], at most.
inline double FarthestBody(const World& a, const World& b) {
  double far = 0;
  const MechanismDynamics &m = a.mechanisms()[0], &n = b.mechanisms()[0];
  for (int i = 0; i < m.mechanism().num_bodies(); ++i)
    far = std::max(far,
                   (m.BodyPose(BodyIndex(i)).translation() - n.BodyPose(BodyIndex(i)).translation()).norm());
  return far;
}

inline StepOptions Still(double h = 1.0 / 60) {
  StepOptions options;
  options.h = h;
  options.gravity.setZero();
  return options;
}

inline const Vector3 kDown(0, 0, -9.81);  // m/s²

inline StepOptions BackwardEuler(double h = 1.0 / 60, const Vector3& gravity_W = Vector3::Zero()) {
  StepOptions options = Still(h);
  options.gravity = gravity_W;
  options.integrator = Integrator::kEuler;
  return options;
}

inline StepOptions TwoStage(double h, const Vector3& gravity_W = Vector3::Zero()) {
  StepOptions options = Still(h);
  options.gravity = gravity_W;
  options.integrator = Integrator::kTwoStage;
  return options;
}

inline GeometryDef Geometry(const std::string& name, const Shape& shape, double friction,
                            const RigidTransform& X_BG = {}) {
  GeometryDef g;
  g.name = name;
  g.shape = shape;
  g.friction = friction;
  g.X_BG = X_BG;
  return g;
}

inline FreeBodyDef BallBody(const std::string& name, double mass, double radius, const Vector3& at,
                            double friction) {
  FreeBodyDef body;
  body.name = name;
  body.X_WB = RigidTransform(at);
  body.inertia = Ball(mass, radius);
  body.geometries.push_back(Geometry(name, Sphere{radius}, friction));
  return body;
}

inline FreeBodyDef BoxBody(const std::string& name, double mass, const Vector3& half, const Vector3& at,
                           double friction) {
  FreeBodyDef body;
  body.name = name;
  body.X_WB = RigidTransform(at);
  body.inertia = Brick(mass, half);
  body.geometries.push_back(Geometry(name, Box{half}, friction));
  return body;
}

/// A bob that moves in the plane y = 0 and hangs at an angle [rad] from the vertical, and a path of this
/// length from the origin to it, the first of paths.
inline MechanismDef BobOnPath(double mass, double length, double angle, const std::string& path) {
  MechanismBuilder builder("bob");
  BodyDef bob;
  bob.name = "bob";
  bob.parent = builder.base();
  bob.X_PB = RigidTransform(length * Vector3(std::sin(angle), 0, -std::cos(angle)));
  bob.inertia = Ball(mass, 0.02);
  const BodyIndex b = builder.AddBody(bob);
  builder.AddJoint(JointDef::Slide("x", b, Vector3::UnitX()));
  builder.AddJoint(JointDef::Slide("z", b, Vector3::UnitZ()));
  builder.SetInterfaces({"bob"});
  MechanismDef def = builder.definition();
  PathElementDef top, end;
  top.body = builder.base();
  end.body = b;
  def.paths.push_back({path, {top, end}});
  return def;
}

/// A floating walker, its base at this height [m], with a ball of 0.02 m at the end of each shank; stiffness
/// [N m/rad] and damping [N m s/rad] of its joints.
inline MechanismDef WalkerOnFeet(double height, double stiffness = 60, double damping = 1) {
  MechanismDef walker = Walker(BaseKind::kFloating, stiffness, damping);
  for (BodyDef& body : walker.bodies)
    if (body.name.rfind("shank", 0) == 0)
      body.geometries.push_back(Geometry(body.name, Sphere{0.02}, 0.8, RigidTransform(Vector3(0.15, 0, 0))));
  walker.X_WR = RigidTransform(Vector3(0, 0, height));
  return walker;
}

/// Momentum [about the world's origin; linear] of all bodies of one mechanism. Armatures carry none.
inline Vector6 Momentum(const MechanismDynamics& m) {
  Vector6 p = Vector6::Zero();
  for (int b = 0; b < m.mechanism().num_bodies(); ++b) {
    const RigidTransform X = m.BodyPose(BodyIndex(b));
    const Vector6 V = m.BodyVelocity(BodyIndex(b));
    const SpatialInertia& I = m.mechanism().body(BodyIndex(b)).inertia_B;
    const Vector3 arm = X.rotation() * I.center;
    const Vector3 linear = I.mass * (V.tail<3>() + V.head<3>().cross(arm));
    p.tail<3>() += linear;
    p.head<3>() += X.rotation() * I.rotational * X.rotation().transpose() * V.head<3>() +
                   Vector3(X.translation() + arm).cross(linear);
  }
  return p;
}

/// Angular momentum about the mechanism's centre of mass, world axes.
inline Vector3 Spin(const MechanismDynamics& m) {
  Vector3 moment = Vector3::Zero();
  for (int b = 0; b < m.mechanism().num_bodies(); ++b) {
    const SpatialInertia& I = m.mechanism().body(BodyIndex(b)).inertia_B;
    moment += I.mass * (m.BodyPose(BodyIndex(b)) * I.center);
  }
  const Vector6 p = Momentum(m);
  return p.head<3>() - (moment / m.mechanism().total_mass()).cross(p.tail<3>());
}

}  // namespace fork1s::testing
