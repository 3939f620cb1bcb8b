// Loads of pairs of bodies over a run.
#include <gtest/gtest.h>

#include <fork1s/sim/simulation.hpp>
#include <fork1s/sim/tally.hpp>

namespace fork1s {
namespace {

// A ball of radius r that slides from the top of a sphere of radius R, without rolling yet. The contact
// normal turns by v h/(R + r) in a step.
Scene BallOnSphere(double friction, double speed) {
  constexpr double kBall = 0.02, kSphere = 0.18, kMass = 0.1;  // m, m, kg
  Scene scene;
  FreeBodyDef ball;
  ball.name = "ball";
  ball.inertia.mass = kMass;
  ball.inertia.rotational = 0.4 * kMass * kBall * kBall * Matrix3::Identity();
  ball.X_WB = RigidTransform(Vector3(0, 0, kSphere + kBall));
  GeometryDef shape;
  shape.name = "ball";
  shape.shape = Sphere{kBall};
  shape.friction = friction;
  ball.geometries.push_back(shape);
  GeometryDef ground = shape;
  ground.name = "ground";
  ground.shape = Sphere{kSphere};
  scene.free_bodies.push_back(ball);
  scene.world.push_back(ground);
  KeyframeDef key;
  KeyframeDef::FreeBodyState start;
  start.X_WB = ball.X_WB;
  start.velocity_W = Vector3(speed, 0, 0);
  key.free_bodies.push_back(start);
  scene.keyframes.push_back(key);
  return scene;
}

// Each stage is at the bound of friction by the normal at its own pose. The sum of its forces, taken apart by
// the normal of the last, uses 1.35 of it.
TEST(Tally, FrictionUseOfASlidingContactIsOneWhereItsNormalTurns) {
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    SimulationOptions options;
    options.dt = 1.0 / 60;
    options.step.integrator = integrator;
    options.initial_keyframe = 0;
    auto made = Simulation::Create(BallOnSphere(0.1, 1), options);
    ASSERT_TRUE(made) << made.error().Text();
    Simulation& simulation = *made;
    RunTally tally;
    tally.Begin(simulation);
    for (int i = 0; i < 4; ++i) {
      const StepReport report = simulation.Step();
      tally.Look(simulation, report);
    }
    const auto pairs = tally.Pairs();
    ASSERT_EQ(pairs.size(), 1u);
    EXPECT_NEAR(pairs[0].use_max, 1, 1e-9);
    EXPECT_NEAR(pairs[0].mean.FrictionUse(), 1, 1e-9);
    EXPECT_GT(pairs[0].slip, 0.03);  // m
  }
}

}  // namespace
}  // namespace fork1s
