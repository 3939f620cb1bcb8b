// A gripper of two sliding fingers that hold a ball between flat or round tips, small enough for closed
// forms.
#pragma once

#include <gtest/gtest.h>

#include <fork1s/mechanism/builder.hpp>
#include <fork1s/sim/simulation.hpp>
#include <stdexcept>

namespace fork1s::testing {

struct Gripper {
  double k = 500;       // N/m, along the grip
  double k_side = 200;  // N/m, across it
  double damping = 5;   // N·s/m
  double friction = 0.5;
  double ball_mass = 0.1;     // kg
  double ball_radius = 0.02;  // m
  double finger_mass = 0.01;  // kg
  double tip = 0;             // m, radius of round tips; 0: flat pads
  BaseKind base = BaseKind::kFixed;

  Scene Make() const {
    MechanismBuilder builder("gripper");
    std::vector<std::string> tips;
    for (const auto& [name, side] : {std::pair<const char*, double>{"left", -1}, {"right", 1}}) {
      BodyDef finger;
      finger.name = name;
      finger.parent = builder.base();
      finger.X_PB = RigidTransform(Vector3(side * (ball_radius + (tip > 0 ? tip : 0.01)), 0, 0));
      finger.inertia.mass = finger_mass;
      finger.inertia.rotational = Vector3::Constant(1e-6).asDiagonal();
      GeometryDef pad;
      pad.name = std::string(name) + "_pad";
      pad.shape = Box{Vector3(0.01, 0.02, 0.02)};
      if (tip > 0) pad.shape = Sphere{tip};
      pad.friction = friction;
      finger.geometries.push_back(pad);
      const BodyIndex b = builder.AddBody(finger);
      // Towards the ball, then across.
      const JointIndex grip = builder.AddJoint(
          JointDef::Slide(std::string(name) + "_grip", b, -side * Vector3::UnitX()).WithSpring(k, damping));
      builder.AddJoint(
          JointDef::Slide(std::string(name) + "_y", b, Vector3::UnitY()).WithSpring(k_side, damping));
      builder.AddJoint(
          JointDef::Slide(std::string(name) + "_z", b, Vector3::UnitZ()).WithSpring(k_side, damping));
      ControlDef control;
      control.name = name;
      control.terms.emplace_back(FreedomRef{grip, 0}, 1.0);
      control.gain = k;
      control.is_setpoint = true;
      builder.AddControl(control);
      tips.push_back(name);
    }
    builder.SetInterfaces(tips);
    Scene scene;
    scene.name = "gripper";
    MechanismDef definition = builder.definition();
    definition.bodies[0].name = "frame";
    definition.base = base;
    scene.mechanisms.push_back(definition);
    FreeBodyDef ball;
    ball.name = "ball";
    ball.inertia.mass = ball_mass;
    ball.inertia.rotational = Vector3::Constant(0.4 * ball_mass * ball_radius * ball_radius).asDiagonal();
    GeometryDef shape;
    shape.name = "ball_shape";
    shape.shape = Sphere{ball_radius};
    shape.friction = friction;
    ball.geometries.push_back(shape);
    scene.free_bodies.push_back(ball);
    return scene;
  }

  Simulation Start(const SimulationOptions& options = {}) const {
    auto simulation = Simulation::Create(Make(), options);
    if (!simulation) throw std::runtime_error(simulation.error().Text());
    return std::move(*simulation);
  }
};

inline void Squeeze(Simulation& simulation, double by) {
  simulation.SetControl("left", by);
  simulation.SetControl("right", by);
}

inline void Steps(Simulation& simulation, int count) {
  for (int i = 0; i < count; ++i) ASSERT_TRUE(simulation.Step().finite) << simulation.time();
}

// Every name of a mechanism with a word before it.
inline void Rename(MechanismDef& def, const std::string& word) {
  for (BodyDef& b : def.bodies) b.name = word + b.name;
  for (JointDef& j : def.joints) j.name = word + j.name;
  for (ControlDef& c : def.controls) c.name = word + c.name;
  for (std::string& name : def.interfaces) name = word + name;
  def.name = word + def.name;
}

// Without one of its fingers: body 1, with joints 0 to 2, or body 2, with the others.
inline MechanismDef WithoutFinger(MechanismDef def, std::size_t finger) {
  const auto at = static_cast<std::ptrdiff_t>(finger);
  def.bodies.erase(def.bodies.begin() + at);
  def.joints.erase(def.joints.begin() + 3 * (at - 1), def.joints.begin() + 3 * at);
  def.controls.erase(def.controls.begin() + at - 1);
  def.interfaces.erase(def.interfaces.begin() + at - 1);
  for (JointDef& j : def.joints) j.body = BodyIndex(1);
  def.controls[0].terms[0].first.joint = JointIndex(0);
  return def;
}

// A gripper whose fingers stand apart, each a mechanism of its own, with a bystander between them in the
// list.
inline Scene Apart(const Gripper& gripper) {
  Scene scene = gripper.Make();
  const MechanismDef both = scene.mechanisms[0];
  MechanismDef left = WithoutFinger(both, 2), right = WithoutFinger(both, 1), other = left;
  right.name = "other gripper";
  right.bodies[0].name = "other frame";
  // The base of the one that joins is turned and elsewhere: poses of its bodies stay.
  right.X_WR = RigidTransform(ExpRotation(Vector3(0.3, -0.2, 0.5)), Vector3(0.1, 0.2, -0.1));
  right.bodies[1].X_PB = right.X_WR.inverse() * right.bodies[1].X_PB;
  Rename(other, "by-");
  other.base = BaseKind::kDriven;
  other.X_WR = RigidTransform(Vector3(0, 0, 1));
  scene.mechanisms = {left, other, right};
  return scene;
}

}  // namespace fork1s::testing
