// A step that meets a number that is not finite is undone and says so.
#include <cmath>
#include <random_mechanism.hpp>
#include <stepping/support.hpp>

#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <limits>

namespace fork1s {
namespace {

TEST(NonFinite, StepIsUndone) {
  // Seven hinges of eight are interior, so that the static answer of the complement is there too.
  MechanismDef walker = testing::Walker(BaseKind::kFloating, 30, 0.5);
  walker.interfaces = {"shank0"};
  Scene scene;
  scene.mechanisms.push_back(walker);
  scene.free_bodies.push_back(testing::BallBody("ball", 1, 0.1, Vector3(3, 0, 0), 0.5));
  World world = testing::MustCreate(scene);
  const StepOptions options;
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(world.Step(options).finite);
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  for (const bool on_ball : {false, true}) {
    MechanismDynamics& m = world.mechanisms()[0];
    FreeBody& ball = world.free_bodies()[0];
    const ReducedState before = m.state();
    const Vector3 ball_at = ball.pose().translation(), ball_speed = ball.velocity_of_center();
    if (on_ball) {
      ball.AddWrench(Vector3(kNaN, 0, 0), Vector3::Zero(), Vector3::Zero());
    } else {
      m.AddWrench(m.mechanism().FindBody("thigh2"), Vector3(0, kNaN, 0), Vector3::Zero(), Vector3::Zero());
    }
    EXPECT_FALSE(world.Step(options).finite);
    EXPECT_EQ(m.state().z, before.z);
    EXPECT_EQ(m.state().w, before.w);
    EXPECT_EQ(m.state().V_R, before.V_R);
    EXPECT_EQ(ball.pose().translation(), ball_at);
    EXPECT_EQ(ball.velocity_of_center(), ball_speed);
    EXPECT_TRUE(world.Step(options).finite);
  }
}

// Forces of any size: a step either ends in a state that the next one can go on from, or leaves every bit as
// it was. Overflow comes late, when velocities are squared or a pose is refreshed.
TEST(NonFinite, NothingOfItStays) {
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage})
    for (const bool loop : {false, true}) {
      testing::RandomMechanismOptions random;
      random.rigid_closures = loop ? 1 : 0;
      World world = testing::MustCreate(testing::RandomMechanismDef(3, random));
      StepOptions options;
      options.integrator = integrator;
      int taken_back = 0;
      for (int power = 20; power <= 320; power += 20) {
        WorldState before, after;
        world.Save(before);
        MechanismDynamics& m = world.mechanisms()[0];
        const double force = power > 308 ? std::numeric_limits<double>::infinity() : std::pow(10.0, power);
        m.AddWrench(BodyIndex(m.mechanism().num_bodies() - 1), Vector3(0.3, force, 0.2), Vector3::Zero(),
                    Vector3(0.1, 0, 0));
        const bool finite = world.Step(options).finite;
        world.Save(after);
        if (!finite) {
          EXPECT_EQ(HashOf(after), HashOf(before)) << power;
          ++taken_back;
        }
        EXPECT_TRUE(IsFinite(m)) << power;
        world.Restore(before);
        EXPECT_TRUE(world.Step(options).finite) << power;  // as if nothing had been
        world.Restore(before);
      }
      EXPECT_GE(taken_back, 1);
    }
}

// Velocities of any size: motions that the search of contacts cannot cover, though every pose is a number.
TEST(NonFinite, MotionBeyondTheRangeOfNumbersIsUndone) {
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage})
    for (int power = 20; power <= 300; power += 20)
      for (const bool turns : {false, true}) {
        MechanismDef walker = testing::Walker(BaseKind::kFloating, 30, 0.5);
        Scene scene;
        scene.mechanisms.push_back(walker);
        scene.world.push_back(testing::Geometry("ground", Plane{}, 0.5));
        scene.free_bodies.push_back(testing::BallBody("ball", 1, 0.1, Vector3(3, 0, 0.1), 0.5));
        World world = testing::MustCreate(scene);
        const Vector3 velocity = Vector3(1, 0.5, -1) * std::pow(10.0, power);
        world.free_bodies()[0].SetState(world.free_bodies()[0].pose(),
                                        turns ? velocity : Vector3(Vector3::Zero()),
                                        turns ? Vector3(Vector3::Zero()) : velocity);
        StepOptions options;
        options.integrator = integrator;
        WorldState before, after;
        world.Save(before);
        before.mechanisms[0].reduced.w.setConstant(velocity.x());
        world.Restore(before);
        world.Save(before);
        const bool finite = world.Step(options).finite;
        world.Save(after);
        if (!finite) {
          EXPECT_EQ(HashOf(after), HashOf(before)) << power;
        }
      }
}

// What contacts bore and where they were is back as well: a step that failed is as if it had not been asked
// for.
TEST(NonFinite, ContactsAreAsTheyWere) {
  Scene scene;
  scene.world.push_back(testing::Geometry("ground", Plane{}, 0.5));
  for (const double x : {0.0, 1.0}) {
    FreeBodyDef ball = testing::BallBody("ball" + std::to_string(x), 1, 0.1, Vector3(x, 0, 0.1), 0.5);
    scene.free_bodies.push_back(ball);
  }
  World world = testing::MustCreate(scene), other = testing::MustCreate(scene);
  const auto roll = [&](World& w) {
    w.free_bodies()[0].AddWrench(Vector3(1, 0.5, 0), Vector3::Zero(),
                                 w.free_bodies()[0].pose().translation());
    return w.Step({});
  };
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(roll(world).finite);
    ASSERT_TRUE(roll(other).finite);
  }
  WorldState before, after;
  world.Save(before);
  ASSERT_GE(before.contacts.size(), 2u);
  world.free_bodies()[1].AddWrench(Vector3(std::nan(""), 0, 0), Vector3::Zero(), Vector3::Zero());
  EXPECT_FALSE(world.Step({}).finite);
  world.Save(after);
  EXPECT_EQ(HashOf(after), HashOf(before));
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(roll(world).finite);
    ASSERT_TRUE(roll(other).finite);
  }
  world.Save(after);
  other.Save(before);
  EXPECT_EQ(HashOf(after), HashOf(before));
}

}  // namespace
}  // namespace fork1s
