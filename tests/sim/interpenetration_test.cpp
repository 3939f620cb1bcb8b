// Interior bodies that pass through what they would have touched.
#include <gtest/gtest.h>

#include <fork1s/mechanism/builder.hpp>
#include <fork1s/sim/simulation.hpp>

#include "sim/interpenetration.hpp"

namespace fork1s {
namespace {

// A ball of radius r on a slide along x, no interface, starts clear of the still box whose face is at x = 0 and moves
// towards it at `speed` [m/s]. A tip behind it is the interface.
Scene BallTowardsWall(double radius, double gap, double speed) {
  Scene scene;
  scene.gravity.setZero();
  const auto geometry = [](const char* name, const Shape& shape) {
    GeometryDef g;
    g.name = name;
    g.shape = shape;
    return g;
  };
  GeometryDef wall = geometry("wall", Box{Vector3::Constant(10 * radius)});
  wall.X_BG.translation().x() = 10 * radius;
  scene.world.push_back(wall);
  MechanismBuilder builder("slider");
  BodyDef ball;
  ball.name = "ball";
  ball.parent = builder.base();
  ball.X_PB.translation().x() = -radius - gap;
  ball.inertia.mass = 1;
  ball.inertia.rotational = 0.4 * radius * radius * Matrix3::Identity();
  ball.geometries.push_back(geometry("ball", Sphere{radius}));
  const BodyIndex b = builder.AddBody(ball);
  const JointIndex slide =
      builder.AddJoint(JointDef::Slide("slide", b, Vector3::UnitX()).WithSpring(1e-6, 0));
  BodyDef tip;
  tip.name = "tip";
  tip.parent = b;
  tip.X_PB.translation().x() = -20 * radius;
  tip.inertia = ball.inertia;
  const BodyIndex t = builder.AddBody(tip);
  builder.AddJoint(JointDef::Hinge("pivot", t, Vector3::UnitZ()).WithSpring(1, 0.1));
  builder.SetInterfaces({"tip"});
  scene.mechanisms.push_back(builder.definition());
  KeyframeDef key;
  key.mechanisms.emplace_back();
  key.mechanisms[0].q = VectorX::Zero(2);
  key.mechanisms[0].q_dot = VectorX::Zero(2);
  key.mechanisms[0].q_dot(slide.value()) = speed;
  scene.keyframes.push_back(key);
  return scene;
}

// From a hundredth of the radius on, whatever the size: what rests on its neighbour sinks by less.
TEST(InterpenetrationMonitor, DepthAtAHundredthOfTheRadius_IsPassingFromThereOn) {
  for (const double radius : {1e-4, 0.1, 100.0})
    for (const double depth : {0.009, 0.011}) {  // of the radius, after one step
      SCOPED_TRACE(::testing::Message() << radius << " " << depth);
      SimulationOptions options;
      options.initial_keyframe = 0;
      options.dt = 1.0 / 60;
      const double gap = 0.05 * radius;
      auto simulation =
          Simulation::Create(BallTowardsWall(radius, gap, 60 * (gap + depth * radius)), options);
      ASSERT_TRUE(simulation) << simulation.error().Text();
      auto watch = InterpenetrationMonitor::Create(*simulation);
      ASSERT_TRUE(watch) << watch.error().Text();
      watch->Update(*simulation);
      EXPECT_TRUE(watch->Found().empty());
      simulation->Step();
      watch->Update(*simulation);
      const std::vector<Interpenetration> found = watch->Found();
      ASSERT_EQ(found.size(), depth > 0.01 ? 1u : 0u);
      if (!found.empty()) {
        EXPECT_NEAR(found[0].depth, depth * radius, 1e-4 * radius);
      }
    }
}

}  // namespace
}  // namespace fork1s
