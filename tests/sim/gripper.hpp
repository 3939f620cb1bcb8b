// A gripper of two sliding fingers that hold a ball between flat-sided tips, small enough for closed forms.
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
  BaseKind base = BaseKind::kFixed;

  Scene Make() const {
    MechanismBuilder builder("gripper");
    std::vector<std::string> tips;
    for (const auto& [name, side] : {std::pair<const char*, double>{"left", -1}, {"right", 1}}) {
      BodyDef finger;
      finger.name = name;
      finger.parent = builder.base();
      finger.X_PB = RigidTransform(Vector3(side * (ball_radius + 0.01), 0, 0));
      finger.inertia.mass = finger_mass;
      finger.inertia.rotational = Vector3::Constant(1e-6).asDiagonal();
      GeometryDef pad;
      pad.name = std::string(name) + "_pad";
      pad.shape = Box{Vector3(0.01, 0.02, 0.02)};
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

}  // namespace fork1s::testing
