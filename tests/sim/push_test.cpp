// Pushes over time: their grammar, their impulse whatever the step, and what frozen contacts bear of them.
#include <cmath>
#include <fork1s/sim/push.hpp>
#include <fork1s/sim/run_statistics.hpp>
#include <functional>

#include "sim/gripper.hpp"

namespace fork1s {
namespace {

using testing::Gripper;
using testing::Squeeze;
using testing::Steps;

TEST(Push, NamesMayHoldColonsAndAts) {
  const auto push = PushTrack::Parse("robot:arm@left:1,2,3,4,5,6@0.1,0,-0.2:0.5..", "--push");
  ASSERT_TRUE(push) << push.error().Text();
  EXPECT_EQ(push->body, "robot:arm@left");
  EXPECT_EQ(push->force_W, Vector3(1, 2, 3));
  EXPECT_EQ(push->moment_W, Vector3(4, 5, 6));
  EXPECT_EQ(push->point_B, Vector3(0.1, 0, -0.2));
  EXPECT_EQ(push->from, 0.5);
  EXPECT_TRUE(std::isinf(push->to));
}

TEST(Push, TakesItsColumnsOutOfATable) {
  ControlTrack track;
  track.names = {"force:a:b:x", "grip", "torque:a:b:z", "force:a:b@0,0,1:x"};
  track.times = {0, 1};
  track.rows = {{0, 7, 2, 5}, {4, 8, 2, 5}};
  const auto pushes = PushTrack::ExtractFrom(track, "table");
  ASSERT_TRUE(pushes) << pushes.error().Text();
  EXPECT_EQ(track.names, std::vector<std::string>{"grip"});
  EXPECT_EQ(track.rows, (std::vector<std::vector<double>>{{7}, {8}}));
  ASSERT_EQ(pushes->pushes.size(), 2u);  // at the origin, and at a point
  EXPECT_EQ(pushes->pushes[0].body, "a:b");
  EXPECT_EQ(pushes->pushes[0].rows[1], (Vector6() << 0, 0, 2, 4, 0, 0).finished());
  EXPECT_EQ(pushes->pushes[1].point_B, Vector3(0, 0, 1));
}

TEST(Push, HasTheSameImpulseAtEveryStep) {
  const Gripper gripper;
  const Simulation simulation = gripper.Start();
  PushTrack track;
  track.pushes.push_back(*PushTrack::Parse("ball:3,0,0:0.0123..0.0789", "--push"));
  for (const double h : {0.1, 1.0 / 60, 0.004, 0.0001}) {
    double impulse = 0;
    for (int i = 1; i * h < 0.2; ++i)
      for (const PushNow& p : track.Over(i * h, h, simulation)) impulse += h * p.force_W.x();
    EXPECT_NEAR(impulse, 3 * (0.0789 - 0.0123), 1e-12) << h;
  }
}

// A push that the grip cannot yield to does not move anything, and still is borne by the frozen contacts.
TEST(Tally, FrozenContactsBearWhatPushes) {
  const Gripper gripper;
  Simulation simulation = gripper.Start();
  Squeeze(simulation, 0.01);
  Steps(simulation, 240);
  ASSERT_TRUE(simulation.SetFidelity({DetailLevel::kObject, -1, Recovery::kExact}));
  const int ball = simulation.FindBody("ball");
  const Vector3 push(0, 0.3, 0);
  RunStatistics statistics;
  for (int i = 0; i < 600; ++i) {
    simulation.ApplyWrench(ball, push, Vector3::Zero(), simulation.Pose(ball).translation());
    simulation.Step();
    statistics.Update(simulation);
  }
  Vector3 sum = Vector3::Zero();
  for (const PairLoad& pair : statistics.Pairs()) {
    const bool is_second = pair.body_b == ball;
    ASSERT_TRUE(is_second || pair.body_a == ball);
    sum += (is_second ? 1 : -1) * pair.last.force_W;
    EXPECT_EQ(pair.slip, 0);
  }
  // At rest what the fingers give balances weight and push.
  EXPECT_NEAR((sum + push - Vector3(0, 0, gripper.ball_mass * 9.81)).norm(), 0, 1e-4);
}

// 2 kg with one geometry, of no shape yet.
FreeBodyDef Sliding() {
  FreeBodyDef body;
  body.name = "body";
  body.inertia.mass = 2;
  body.geometries.emplace_back().friction = 0.4;
  return body;
}

Scene OnTheFloor(const FreeBodyDef& body, const Vector3& omega, const Vector3& velocity) {
  Scene scene;
  scene.name = "floor";
  GeometryDef floor;
  floor.shape = Plane{};
  floor.friction = 0.4;
  scene.world.push_back(floor);
  scene.free_bodies.push_back(body);
  KeyframeDef start;
  start.free_bodies.push_back({body.X_WB, omega, velocity});
  scene.keyframes.push_back(start);
  return scene;
}

// A box that slides to a stop, and a ball that spins to one on its spot: friction takes all that they had.
TEST(Tally, FrictionTakesWhatMoved) {
  for (const bool spins : {false, true}) {
    FreeBodyDef body = Sliding();
    body.inertia.rotational = Vector3::Constant(2e-3).asDiagonal();
    GeometryDef& shape = body.geometries[0];
    if (spins)
      shape.shape = Sphere{0.05};
    else
      shape.shape = Box{Vector3(0.1, 0.1, 0.05)};
    shape.torsion = 0.01;
    shape.moments = spins ? 1 : 0;
    body.X_WB = RigidTransform(Vector3(0, 0, 0.05));
    const Scene scene = OnTheFloor(body, spins ? Vector3(0, 0, 20) : Vector3::Zero(),
                                   spins ? Vector3::Zero() : Vector3(1.5, 0, 0));
    SimulationOptions options;
    options.initial_keyframe = 0;
    auto simulation = Simulation::Create(scene, options);
    ASSERT_TRUE(simulation) << simulation.error().Text();
    const double moving = simulation->KineticEnergy();
    RunStatistics statistics;
    statistics.Begin(*simulation);
    for (int i = 0; i < 300; ++i) {
      simulation->Step();
      statistics.Update(*simulation);
    }
    ASSERT_LT(simulation->KineticEnergy(), 1e-9 * moving);
    // But for the first step, before which nothing touched, and for what the material keeps in it: a
    // thousandth.
    EXPECT_NEAR(statistics.FrictionLoss(), moving, (spins ? 1e-6 : 3e-3) * moving) << spins;
  }
}

// A ball that slides across its spin and is elsewhere by the end of a step: its point of contact is where it was.
TEST(Tally, FrictionTakesWhatSlidAcrossItsSpin) {
  FreeBodyDef body = Sliding();
  body.inertia.rotational = Vector3::Constant(0.02).asDiagonal();
  body.geometries[0].shape = Sphere{0.1};
  body.X_WB = RigidTransform(Vector3(0, 0, 0.1));
  const Scene scene = OnTheFloor(body, Vector3(40, 0, 20), Vector3(4, 0, 0));
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    SimulationOptions options;
    options.initial_keyframe = 0;
    options.dt = 1.0 / 240;
    options.step.integrator = integrator;
    auto simulation = Simulation::Create(scene, options);
    ASSERT_TRUE(simulation) << simulation.error().Text();
    const double moving = simulation->KineticEnergy();
    RunStatistics statistics;
    statistics.Begin(*simulation);
    for (int i = 0; i < 240; ++i) {
      simulation->Step();
      statistics.Update(*simulation);
    }
    const double lost = moving - simulation->KineticEnergy();
    // Half of m/2, what the point of contact weighs where I = m r², times the square of its slip, 4 m/s each way.
    EXPECT_NEAR(lost, 16, 0.02 * 16);
    // But for the first step, before which nothing touched, and the one within which it begins to roll.
    EXPECT_NEAR(statistics.FrictionLoss(), lost, 0.02 * lost);
  }
}

TEST(Simulation, UnknownNamesAreAnsweredInTheUsersWords) {
  Simulation simulation = Gripper().Start();
  for (const auto& call : {std::function<void()>([&] { simulation.Pose("bal"); }),
                           std::function<void()>([&] { simulation.SetControl("bal", 1); })})
    try {
      call();
      ADD_FAILURE() << "took a name that is none";
    } catch (const std::invalid_argument& e) {
      const std::string text = e.what();
      EXPECT_NE(text.find("'bal'"), std::string::npos) << text;
      EXPECT_NE(text.find("left"), std::string::npos) << text;
      EXPECT_EQ(text.find(".cpp"), std::string::npos) << text;
    }
}

}  // namespace
}  // namespace fork1s
