// Clocks between the parts of a step: that they are there and change nothing, not how long anything takes.
#include <stepping/support.hpp>

#include "world/step_times.hpp"

namespace fork1s {
namespace {

TEST(WorldWatch, PartsOfAStepAddUpAndChangeNothing) {
  MechanismDef walker = testing::Walker(BaseKind::kFloating, 60, 1);
  walker.X_WR = RigidTransform(Vector3(0, 0, 1));
  const int n = BuildMechanism(walker)->num_coordinates();
  Scene scene = testing::Started(walker, VectorX::Zero(n), VectorX::Constant(n, 3.0));
  scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
  scene.free_bodies.push_back(testing::BallBody("ball", 0.1, 0.05, Vector3(1, 1, 0.05), 0.8));
  scene.keyframes[0].free_bodies.push_back({scene.free_bodies[0].X_WB});
  int refreshes = 0;
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    World::Options options;
    options.initial_keyframe = 0;
    options.refresh_angle = 1e-3;
    options.recovery = Recovery::kTwist;  // whose reference ages
    World watched = testing::MustCreate(scene, options), alone = testing::MustCreate(scene, options);
    StepPartTimes times;
    watched.Watch(&times);
    StepOptions step;
    step.integrator = integrator;
    for (int i = 0; i < 60; ++i) {
      const int refreshed = watched.Step(step).refreshes;
      refreshes += refreshed;
      alone.Step(step);
      double sum = 0;
      for (const auto& [name, seconds] : PartsOf(times)) {
        EXPECT_GE(seconds, -1e-9) << name;
        sum += seconds;
      }
      EXPECT_NEAR(sum, times.all, 1e-9);
      EXPECT_GT(times.finding, 0);
      EXPECT_GT(times.free_velocities, 0);
      EXPECT_GT(times.moving, 0);
      if (refreshed > 0) {
        EXPECT_GT(times.refreshing, 0);
      }
    }
    WorldState a, b;
    watched.Save(a);
    alone.Save(b);
    EXPECT_EQ(HashOf(a, VectorX()), HashOf(b, VectorX()));
    const double last = times.all;
    watched.Watch(nullptr);
    watched.Step(step);
    EXPECT_EQ(times.all, last);
  }
  EXPECT_GT(refreshes, 0);
}

}  // namespace
}  // namespace fork1s
