// Torsional and rolling friction of contacts, against closed forms.
#include <cmath>

#include "support.hpp"

namespace fork1s {
namespace {

constexpr double kFall = 9.81, kBall = 0.05, kBallMass = 0.3;  // m/s², m, kg

/// A ball on a plane; the pair bears `moments` (1 torsion, 2 rolling too) by the ball's coefficients.
Scene OnPlane(double torsion, double rolling, int moments, const Vector3& omega, const Vector3& velocity) {
  Scene scene;
  scene.world.push_back(testing::Geometry("floor", Plane{}, 1));
  scene.world[0].torsion = scene.world[0].rolling = 0;
  FreeBodyDef ball = testing::BallBody("ball", kBallMass, kBall, Vector3(0, 0, kBall), 1);
  ball.geometries[0].torsion = torsion;
  ball.geometries[0].rolling = rolling;
  ball.geometries[0].moments = moments;
  scene.free_bodies.push_back(ball);
  KeyframeDef key;
  key.free_bodies.push_back({ball.X_WB, omega, velocity});
  scene.keyframes.push_back(key);
  return scene;
}

World Begin(const Scene& scene) {
  World::Options options;
  options.initial_keyframe = 0;
  return testing::MustCreate(scene, options);
}

// A disc on a point, or a ball: the moment is torsion times the weight until it stands still, and then what
// it takes.
TEST(Moments, ASpinSlowsAtTheRateOfItsTorsionalFriction) {
  const double torsion = 0.004, inertia = 0.4 * kBallMass * kBall * kBall;
  const double rate = torsion * kBallMass * kFall / inertia;  // rad/s²
  World world = Begin(OnPlane(torsion, 0, 1, Vector3(0, 0, 30), Vector3::Zero()));
  const StepOptions step;
  for (int i = 1; i <= 180; ++i) {
    world.Step(step);
    const double expected = std::max(0.0, 30 - rate * i * step.h);
    // While the material takes up the load the ball sinks, at first at a thousandth of g h, and the normal
    // impulses so far lack the momentum of that.
    const double sinks = 1e-3 * kFall * step.h * rate / kFall;
    EXPECT_NEAR(world.free_bodies()[0].omega_W().z(), expected, sinks + 1e-12) << i;
  }
  EXPECT_LT(world.free_bodies()[0].omega_W().norm(), 1e-9);
  EXPECT_GT(30 / rate, 0.2);  // it did turn for a while
}

TEST(Moments, WithoutThemASpinGoesOn) {
  World world = Begin(OnPlane(0.004, 0, 0, Vector3(0, 0, 30), Vector3::Zero()));
  for (int i = 0; i < 60; ++i) world.Step(StepOptions{});
  EXPECT_NEAR(world.free_bodies()[0].omega_W().z(), 30, 1e-9);
}

// A ball that rolls without slipping: (7/5) m r² ω̇ = -rolling m g.
TEST(Moments, ARollingBallSlowsAtTheRateOfItsRollingFriction) {
  const double rolling = 0.002, speed = 1;
  World world = Begin(OnPlane(0, rolling, 2, Vector3(0, speed / kBall, 0), Vector3(speed, 0, 0)));
  const double slowing = rolling * kFall / (1.4 * kBall);  // m/s²
  const StepOptions step;
  for (int i = 0; i < 60; ++i) world.Step(step);
  EXPECT_NEAR(world.free_bodies()[0].velocity_of_center().x(), speed - slowing, 1e-4 * slowing);
  for (int i = 0; i < 240; ++i) world.Step(step);
  // A tenth of the solver's tolerance of 1e-4, of the speed g h = 0.16 m/s at hand.
  EXPECT_LT(world.free_bodies()[0].velocity_of_center().norm(), 1.6e-6);
  EXPECT_GT(world.free_bodies()[0].pose().translation().x(), 0.9 * speed * speed / (2 * slowing));
}

// Two balls on one another, the lower one held by the floor: torsion acts between moving bodies too, and
// keeps the sum of their spins about the common axis when the floor bears none.
TEST(Moments, BetweenTwoBodiesTheyKeepTheSpinOfBoth) {
  Scene scene = OnPlane(0.004, 0, 1, Vector3(0, 0, 20), Vector3::Zero());
  scene.world[0].priority = 1;  // decides for its pairs: no moments, and no friction either
  scene.world[0].friction = 0;
  FreeBodyDef upper = testing::BallBody("upper", kBallMass, kBall, Vector3(0, 0, 3 * kBall), 1);
  upper.geometries[0].torsion = 0.004;
  upper.geometries[0].moments = 1;
  scene.free_bodies.push_back(upper);
  scene.keyframes[0].free_bodies.push_back({upper.X_WB, Vector3::Zero(), Vector3::Zero()});
  World world = Begin(scene);
  for (int i = 0; i < 120; ++i) world.Step(StepOptions{});
  const double a = world.free_bodies()[0].omega_W().z(), b = world.free_bodies()[1].omega_W().z();
  EXPECT_NEAR(a + b, 20, 1e-9);
  EXPECT_NEAR(a, 10, 1e-3);  // they end as one
}

}  // namespace
}  // namespace fork1s
