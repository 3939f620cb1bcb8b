#include "continuum_arm.hpp"

#include <algorithm>
#include <numbers>

#include <fmt/format.h>

namespace fork1s::examples {
namespace {

enum Axis { kTwist, kBendY, kBendZ };

constexpr double kBallRadius = 0.03, kBallMass = 0.2;  // m, kg

GeometryDef Drawn(const std::string& name, const Shape& shape, const RigidTransform& X_BG,
                  const Vector4& rgba) {
  GeometryDef g;
  g.name = name;
  g.shape = shape;
  g.X_BG = X_BG;
  g.rgba = rgba;
  g.contype = g.conaffinity = 0;
  return g;
}

// A link reaches from its own hinge to the next one, half a link behind the end of the arm.
BodyDef Link(const ContinuumArm& arm, int i, BodyIndex parent) {
  const double pitch = arm.length / arm.joints;
  const bool last = i + 1 == arm.joints;
  const double length = last ? 0.5 * pitch : pitch, mass = arm.mass * length / arm.length;
  BodyDef link;
  link.name = fmt::format("link{}", i);
  link.parent = parent;
  link.X_PB = RigidTransform(Vector3(i == 0 ? 0.5 * pitch : pitch, 0, 0));
  const double across = mass * (arm.radius * arm.radius / 4 + length * length / 12);
  link.inertia = {mass, Vector3(0.5 * length, 0, 0),
                  Vector3(mass * arm.radius * arm.radius / 2, across, across).asDiagonal()};
  const RigidTransform along(Matrix3(ExpRotation(Vector3(0, 0.5 * std::numbers::pi, 0))),
                             Vector3(0.5 * length, 0, 0));
  link.geometries.push_back(
      Drawn(link.name + "_rod", Cylinder{0.006, 0.5 * length}, along, Vector4(0.85, 0.8, 0.6, 1)));
  // A disc every 30 mm or so.
  const int every = std::max(1, static_cast<int>(0.03 / pitch + 0.5));
  if (i % every == 0)
    link.geometries.push_back(
        Drawn(link.name + "_disc", Cylinder{arm.radius, 0.002}, along, Vector4(0.25, 0.35, 0.5, 1)));
  if (last) {
    GeometryDef tip;
    tip.name = "tip";
    tip.shape = Sphere{arm.radius};
    tip.X_BG = RigidTransform(Vector3(length, 0, 0));
    tip.friction = arm.friction;
    tip.rgba = Vector4(0.8, 0.3, 0.2, 1);
    link.geometries.push_back(tip);
  }
  return link;
}

}  // namespace

MechanismDef MakeContinuumArm(const ContinuumArm& arm) {
  FORK1S_REQUIRE(arm.joints >= 3 && arm.length > 0, arm.joints, arm.length);
  MechanismBuilder builder("arm");
  ControlDef curl, sway;
  curl.name = "curl";
  sway.name = "sway";
  BodyIndex parent = builder.base();
  const double stretch = 3 * arm.length / arm.joints;
  for (int i = 0; i < arm.joints; ++i) {
    const Axis axis = static_cast<Axis>(i % 3);
    parent = builder.AddBody(Link(arm, i, parent));
    const double stiffness = (axis == kTwist ? arm.twisting : arm.bending) / stretch;
    const JointIndex joint =
        builder.AddJoint(JointDef::Hinge(fmt::format("joint{}", i), parent, Vector3(Vector3::Unit(axis)))
                             .WithSpring(stiffness, arm.damping_time * stiffness));
    if (axis == kBendY) curl.terms.emplace_back(FreedomRef{joint, 0}, 1.0);
    if (axis == kBendZ) sway.terms.emplace_back(FreedomRef{joint, 0}, 1.0);
  }
  for (ControlDef* control : {&curl, &sway}) {
    control->gain = arm.bending;  // the moment that bends a free rod to curvature 1
    control->is_setpoint = true;
    builder.AddControl(*control);
  }
  builder.SetInterfaces({fmt::format("link{}", arm.joints - 1)});
  return ScaleStiffness(builder.definition(), arm.stiffness_scale);
}

Scene ContinuumArmScene(const ContinuumArm& arm) {
  Scene scene;
  scene.name = fmt::format("arm{}", arm.joints);
  scene.mechanisms.push_back(MakeContinuumArm(arm));
  GeometryDef table;
  table.name = "table";
  table.shape = Plane{};
  table.X_BG = RigidTransform(Vector3(0, 0, arm.table));
  table.friction = arm.friction;
  scene.world.push_back(table);
  if (!arm.ball) return scene;
  FreeBodyDef ball;
  ball.name = "ball";
  ball.X_WB = RigidTransform(Vector3(arm.length - 0.01, 0.12, arm.table + kBallRadius));
  ball.inertia.mass = kBallMass;
  ball.inertia.rotational = 0.4 * kBallMass * kBallRadius * kBallRadius * Matrix3::Identity();
  GeometryDef shape;
  shape.name = "ball";
  shape.shape = Sphere{kBallRadius};
  shape.friction = arm.friction;
  shape.rgba = Vector4(0.3, 0.5, 0.8, 1);
  ball.geometries.push_back(shape);
  scene.free_bodies.push_back(ball);
  return scene;
}

ControlTrack ContinuumArmMotion() {
  ControlTrack track;
  track.names = {"curl", "sway"};
  auto smooth = [](double t, double from, double to) {
    const double s = std::clamp((t - from) / (to - from), 0.0, 1.0);
    return s * s * s * (10 + s * (6 * s - 15));
  };
  // A curvature of 2 d / L² moves a free tip by d: 70 mm down, of which the table leaves 39 with the arm's
  // own droop of 11, and 200 mm aside.
  const double down = 2 * 0.07 / 0.81, aside = 2 * 0.2 / 0.81;
  for (int i = 0; i <= 240; ++i) {
    const double t = i / 60.0;
    track.times.push_back(t);
    track.rows.push_back({down * (smooth(t, 0, 1) - smooth(t, 3, 4)), aside * smooth(t, 1.2, 2.5)});
  }
  return track;
}

}  // namespace fork1s::examples
