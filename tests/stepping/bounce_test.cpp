// What has restitution parts again with its share of the speed.
#include <gtest/gtest.h>

#include "mechanism/restitution.hpp"
#include "support.hpp"

namespace fork1s {
namespace {

constexpr double kBouncingRadius = 0.05, kDrop = 0.5, kBouncingMass = 0.3;

// A ball over a plane whose pair has a given restitution, dropped from a height that no step ends at.
Scene BallOverPlane(double restitution) {
  Scene scene;
  scene.world.push_back(testing::Geometry("ground", Plane{}, 0.5));
  scene.free_bodies.push_back(
      testing::BallBody("ball", kBouncingMass, kBouncingRadius, Vector3(0, 0, kBouncingRadius + kDrop), 0.5));
  scene.world[0].restitution = scene.free_bodies[0].geometries[0].restitution = restitution;
  return scene;
}

double EnergyOf(const World& world) {
  // Above that of the ball on the ground.
  return world.KineticEnergy() + world.PotentialEnergy(Vector3(0, 0, -9.81)) -
         kBouncingMass * 9.81 * kBouncingRadius;
}

TEST(Bounce, EveryBounceLeavesTheSquareOfRestitution) {
  for (double h : {1.0 / 60, 1.0 / 240}) {
    for (double e : {0.3, 0.7, 0.95}) {
      SCOPED_TRACE(::testing::Message() << "h " << h << " e " << e);
      World world = testing::MustCreate(BallOverPlane(e));
      StepOptions step;
      step.h = h;
      step.integrator = Integrator::kTwoStage;
      double before = EnergyOf(world), last = before;
      bool touched = false;
      int bounces = 0;
      for (int i = 0; i < 2 / h && bounces < 2; ++i) {
        const StepReport report = world.Step(step);
        const double now = EnergyOf(world);
        const bool touches = report.solver.active > 0;
        if (touched && !touches) {  // it flies again
          ++bounces;
          // The material gives a thousandth of the change of speed, 1 + 1/e times the speed that is left. A
          // bounce lower than the way of a step begins a step late, with g h less of its speed of touch.
          const double touch = std::sqrt(2 * before / kBouncingMass),
                       late = e * e * touch < 9.81 * h ? 9.81 * h / touch : 0;
          EXPECT_LE(last, e * e * before * (1 + 0.003 * (1 + 1 / e))) << i;
          // Up to another hundredth is lost in parts of the step after the bounce.
          EXPECT_GE(last, e * e * before * (1 - 0.003 * (1 + 1 / e) - 2 * late - 0.01)) << i;
          before = last;
        }
        if (!touches && !touched) {
          EXPECT_NEAR(now, last, 1e-9 * before) << i;  // flight keeps what there is
        }
        touched = touches;
        last = now;
      }
      EXPECT_EQ(bounces, 2);
    }
  }
}

TEST(Bounce, NothingGainsAndAllComesToRest) {
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    World world = testing::MustCreate(BallOverPlane(0.6));
    StepOptions step;
    step.integrator = integrator;
    double before = EnergyOf(world);
    for (int i = 0; i < 300; ++i) {
      // What the landing presses in comes back to the depth that the weight holds.
      const double overlap = std::max(0.0, kBouncingRadius - world.free_bodies()[0].center_W().z());
      world.Step(step);
      EXPECT_LE(EnergyOf(world), before * (1 + 1e-9) + 1e-9 + kBouncingMass * 9.81 * overlap) << i;
      before = EnergyOf(world);
    }
    EXPECT_LT(world.free_bodies()[0].velocity().center.norm(), 1e-9);
    EXPECT_NEAR(world.free_bodies()[0].pose().translation().z(), kBouncingRadius, 2e-5);  // 10 µm of material
  }
}

TEST(Bounce, WithoutRestitutionItStays) {
  World world = testing::MustCreate(BallOverPlane(0));
  StepOptions step;
  double highest = 0;
  bool met = false;
  for (int i = 0; i < 120; ++i) {
    met = world.Step(step).solver.active > 0 || met;
    if (met) highest = std::max(highest, world.free_bodies()[0].pose().translation().z() - kBouncingRadius);
  }
  EXPECT_TRUE(met);
  EXPECT_LT(highest, 1e-4);
}

TEST(Bounce, TwoBallsExchangeTheirSpeeds) {
  // Equal balls in line without weight: with restitution 1 the one that ran stands and the other runs on.
  Scene scene;
  for (int i = 0; i < 2; ++i) {
    scene.free_bodies.push_back(
        testing::BallBody(i == 0 ? "first" : "second", 0.3, kBouncingRadius, Vector3(0.33 * i, 0, 0), 0));
    scene.free_bodies.back().geometries[0].restitution = 1;
  }
  KeyframeDef key;
  for (const FreeBodyDef& body : scene.free_bodies)
    key.free_bodies.push_back({body.X_WB, Vector3::Zero(), Vector3::Zero()});
  key.free_bodies[0].velocity_W = Vector3(2, 0, 0);
  scene.keyframes.push_back(key);
  World::Options options;
  options.initial_keyframe = 0;
  World world = testing::MustCreate(scene, options);
  for (int i = 0; i < 60; ++i) world.Step(testing::Still());
  EXPECT_NEAR(world.free_bodies()[0].velocity().center.x(), 0, 0.004);
  EXPECT_NEAR(world.free_bodies()[1].velocity().center.x(), 2, 0.004);
}

TEST(Bounce, RestitutionAndDampingRatioAreOneProperty) {
  for (double e : {0.0, 0.01, 0.5, 0.9, 1.0}) EXPECT_NEAR(RestitutionOf(DampingRatioOf(e)), e, 1e-12);
  EXPECT_EQ(RestitutionOf(1), 0);
  EXPECT_NEAR(RestitutionOf(0.2), std::exp(-M_PI * 0.2 / std::sqrt(0.96)), 1e-15);
}

}  // namespace
}  // namespace fork1s
