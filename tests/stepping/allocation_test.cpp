// A step without a refresh must not touch the heap once it is warm.
#include <allocation_counter.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::allocations;

TEST(WorldAllocation, NoneInAStep) {
  // A floating walker that stands, a loop with limits that touches a box, and a ball.
  const MechanismDef walker = testing::WalkerOnFeet(0.025);
  MechanismDef bar = testing::FourBar().Definition();
  bar.X_WR = RigidTransform(Vector3(2, 0, 0.1));
  bar.bodies[0].name = "ground";
  bar.bodies[2].geometries.push_back(testing::Geometry("paddle", Sphere{0.03}, 0.8));
  bar.joints[0].WithLimits(-0.05, 0.05);
  Scene scene;
  scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
  scene.mechanisms = {walker, bar};
  scene.free_bodies.push_back(testing::BallBody("ball", 0.1, 0.05, Vector3(1, 1, 0.05), 0.8));
  scene.free_bodies.push_back(
      testing::BoxBody("box", 1, Vector3(0.05, 0.05, 0.05), Vector3(2, 0.1, 0.18), 0.8));
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    World world = testing::MustCreate(scene);
    StepOptions step;
    step.integrator = integrator;
    step.refresh = false;
    const auto push = [&] {
      MechanismDynamics& m = world.mechanisms()[0];
      const BodyIndex last(m.mechanism().num_bodies() - 1);
      m.AddWrench(last, Vector3(0.1, 0, 0), Vector3(0, 0.01, 0), m.BodyPose(last).translation());
      FreeBody& ball = world.free_bodies()[0];
      ball.AddWrench(Vector3(0, 0, -0.1), Vector3::Zero(), ball.pose() * Vector3(0.01, 0, 0));
      if (integrator != Integrator::kTwoStage) return;  // the others make it a force of the step
      m.SetPointSpring(last, {Vector3(0.01, 0, 0), Vector3(0, 0, 0.2), Vector3(0, 0.01, 0.2), 10, 1});
      ball.SetPointSpring({Vector3(0.01, 0, 0), Vector3(1, 1, 0.1), Vector3(1, 1.01, 0.1), 10, 1});
    };
    for (int i = 0; i < 30; ++i) {
      push();
      world.Step(step);
    }
    int contacts = 0;
    const long before = allocations.load();
    EXPECT_EQ(before > 0, testing::kCountsAllocations);
    for (int i = 0; i < 60; ++i) {
      push();
      contacts += world.Step(step).contacts;
    }
    const long after = allocations.load();
    EXPECT_EQ(after, before) << static_cast<int>(integrator);
    EXPECT_GT(contacts, 60);
  }
}

// Nor one that an impact is in, once one has been.
TEST(WorldAllocation, NoneInAStepThroughAnImpact) {
  const MechanismDef walker = testing::WalkerOnFeet(0.04);
  Scene scene;
  scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
  scene.mechanisms = {walker};
  scene.free_bodies.push_back(testing::BallBody("ball", 0.1, 0.05, Vector3(1, 1, 0.3), 0.8));
  World world = testing::MustCreate(scene);
  StepOptions step;
  step.integrator = Integrator::kTwoStage;
  step.refresh = false;
  WorldState start;
  world.Save(start);
  const auto fall = [&] {
    int impacts = 0;
    for (int i = 0; i < 40; ++i) impacts += world.Step(step).impact ? 1 : 0;
    return impacts;
  };
  const int first = fall();
  EXPECT_GE(first, 2);
  world.Restore(start);
  const long before = allocations.load();
  EXPECT_EQ(fall(), first);
  EXPECT_EQ(allocations.load(), before);
}

}  // namespace
}  // namespace fork1s
