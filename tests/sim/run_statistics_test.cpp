// Loads of pairs of bodies over a run.
#include <gtest/gtest.h>

#include <cmath>
#include <fork1s/sim/run_statistics.hpp>
#include <fork1s/sim/simulation.hpp>

namespace fork1s {
namespace {

// A ball of radius r that slides from the top of a sphere of radius R, without rolling yet. The contact
// normal turns by v h/(R + r) in a step. Lengths are multiplied by `scale`, masses by its third power.
Scene BallOnSphere(double friction, double speed, double scale = 1) {
  const double kBall = 0.02 * scale, kSphere = 0.18 * scale, kMass = 0.1 * std::pow(scale, 3);  // m, m, kg
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
  start.velocity_W = Vector3(scale * speed, 0, 0);
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
    RunStatistics statistics;
    statistics.Begin(simulation);
    for (int i = 0; i < 4; ++i) {
      simulation.Step();
      statistics.Update(simulation);
    }
    const auto pairs = statistics.Pairs();
    ASSERT_EQ(pairs.size(), 1u);
    EXPECT_NEAR(pairs[0].use_max, 1, 1e-9);
    EXPECT_NEAR(pairs[0].mean.FrictionUse(), 1, 1e-9);
    EXPECT_GT(pairs[0].slip, 0.03);  // m
  }
}

// In micrometres or kilometres a statistics tells the same of a motion.
TEST(Tally, Slip_ScaledScene_ScalesWithIt) {
  const auto slip_of = [](double scale) {
    SimulationOptions options;
    options.initial_keyframe = 0;
    options.step.material.depth *= scale;
    options.step.material.stiffness *= std::pow(scale, 3);
    options.step.material.max_push_speed *= scale;
    options.collision.margin *= scale;
    Scene scene = BallOnSphere(0.1, 0.1, scale);
    scene.gravity *= scale;
    auto simulation = Simulation::Create(scene, options);
    EXPECT_TRUE(simulation) << simulation.error().Text();
    RunStatistics statistics;
    statistics.Begin(*simulation);
    for (int i = 0; i < 10; ++i) {
      simulation->Step();
      statistics.Update(*simulation);
    }
    const auto pairs = statistics.Pairs();
    EXPECT_EQ(pairs.size(), 1u);
    return pairs.at(0).slip;
  };
  const double slip = slip_of(1);
  EXPECT_GT(slip, 5e-4);
  for (const double scale : {1e-6, 1e-3, 1e3})  // to the tolerance of a step's solution
    EXPECT_NEAR(slip_of(scale) / scale, slip, 1e-6) << scale;
}

// A box of m on a plane under gravity tilted by a uses tan(a)/µ of its friction; pushed by F, F/(µ m g).
TEST(Tally, FrictionUseOfABoxOnASlopeAndOfAPushedBoxIsItsClosedForm) {
  constexpr double kMass = 1, kFriction = 0.8, kG = 9.81, kAngle = 0.3, kPush = 2;  // kg, 1, m/s², rad, N
  for (const bool slope : {true, false}) {
    Scene scene;
    scene.gravity = slope ? Vector3(kG * std::sin(kAngle), 0, -kG * std::cos(kAngle)) : Vector3(0, 0, -kG);
    FreeBodyDef box;
    box.name = "box";
    box.inertia.mass = kMass;
    box.inertia.rotational = kMass / 6 * 0.01 * Matrix3::Identity();  // of a cube of 0.1 m
    box.X_WB = RigidTransform(Vector3(0, 0, 0.05));
    GeometryDef shape;
    shape.name = "box";
    shape.shape = Box{Vector3(0.05, 0.05, 0.05)};
    shape.friction = kFriction;
    box.geometries.push_back(shape);
    GeometryDef ground = shape;
    ground.name = "ground";
    ground.shape = Box{Vector3(1, 1, 0.05)};
    ground.X_BG = RigidTransform(Vector3(0, 0, -0.05));
    scene.free_bodies.push_back(box);
    scene.world.push_back(ground);
    auto simulation = Simulation::Create(scene, {});
    ASSERT_TRUE(simulation) << simulation.error().Text();
    RunStatistics statistics;
    statistics.Begin(*simulation);
    for (int i = 0; i < 60; ++i) {
      const Vector3 at_plane = simulation->Pose(0).translation() - Vector3(0, 0, 0.05);
      if (!slope) simulation->ApplyWrench(0, Vector3(kPush, 0, 0), Vector3::Zero(), at_plane);
      simulation->Step();
      statistics.Update(*simulation);
    }
    const auto bodies = statistics.BodyFrictions();
    ASSERT_EQ(bodies.size(), 1u);
    ASSERT_FALSE(bodies[0].course.empty());
    const double closed = slope ? std::tan(kAngle) / kFriction : kPush / (kFriction * kMass * kG);
    EXPECT_NEAR(bodies[0].course.back().use, closed, 0.01 * closed)
        << slope;  // at rest within the solver's tolerance
    EXPECT_GE(bodies[0].use_max, bodies[0].use_mean);
    const PairLoad pair = statistics.Pairs().at(0);
    EXPECT_GE(pair.normal_max, pair.last.normal);
    EXPECT_GE(pair.tangential_max, pair.last.tangential);
  }
}

}  // namespace
}  // namespace fork1s
