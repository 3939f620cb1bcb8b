#include "diagnostics/point_response.hpp"

#include <stepping/support.hpp>

namespace fork1s {
namespace {

// Where the point is after a step of backward Euler under a force on it.
Vector3 After(World& world, const WorldState& start, BodyIndex body, const Vector3& point_B,
              const StepOptions& step, const Vector3& force) {
  world.Restore(start);
  MechanismDynamics& m = world.mechanisms()[0];
  m.AddWrench(body, force, Vector3::Zero(), m.BodyPose(body) * point_B);
  EXPECT_TRUE(world.Step(step).stages_converged);
  return m.BodyPose(body) * point_B;
}

TEST(PointResponse, IsWhatAStepDoesWithAForce) {
  const Vector3 point_B(0.01, 0.02, -0.01);
  const StepOptions step = testing::BackwardEuler(1.0 / 60, Vector3(0, 0.3, -9.81));
  for (const MechanismDef& definition :
       {testing::Chain(3, 0.1, 0.05, 0.4, 0.001, true), testing::Walker(BaseKind::kFixed, 60, 1)}) {
    World::Options options;
    options.reduction.modes = 20;
    World world = testing::MustCreate(definition, options);
    for (int i = 0; i < 5; ++i) world.Step(step);
    WorldState start;
    world.Save(start);
    const MechanismDynamics& m = world.mechanisms()[0];
    const BodyIndex body = m.model().interfaces.back();
    const PointResponse found = RespondAt(m, body, point_B, step.h);
    EXPECT_EQ(found.mass, m.mechanism().total_mass());
    EXPECT_TRUE(found.W.isApprox(found.W.transpose(), 1e-12));
    const Vector3 unmoved = After(world, start, body, point_B, step, Vector3::Zero());
    for (int axis = 0; axis < 3; ++axis) {
      // To what the pose turns in the step.
      const Vector3 force = 1e-3 * Vector3::Unit(axis), foreseen = step.h * step.h * found.W * force,
                    moved = After(world, start, body, point_B, step, force) - unmoved;
      EXPECT_LT((moved - foreseen).norm(), 0.05 * foreseen.norm())
          << definition.name << ' ' << axis << ' ' << moved.transpose() << " for " << foreseen.transpose();
    }
  }
}

TEST(PointResponse, OfAFreeBody) {
  const FreeBody body(testing::BallBody("ball", 0.5, 0.1, Vector3::Zero(), 1));
  const PointResponse found = RespondAt(body, Vector3::Zero());
  EXPECT_TRUE(found.W.isApprox(2 * Matrix3::Identity(), 1e-12));
  EXPECT_EQ(found.mass, 0.5);
}

}  // namespace
}  // namespace fork1s
