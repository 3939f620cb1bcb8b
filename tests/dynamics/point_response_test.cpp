#include <fork1s/dynamics/point_response.hpp>

#include <dynamics/support.hpp>

namespace fork1s {
namespace {

// Where the point is after a step of implicit Euler under a force on it.
Vector3 After(MechanismDynamics m, BodyIndex body, const Vector3& point_B, double h, const Vector3& gravity,
              const Vector3& force) {
  m.AddWrench(body, force, Vector3::Zero(), m.BodyPose(body) * point_B);
  if (m.recovery() != Recovery::kTwist) Begin(m, h, gravity, StepRule::kEuler);
  m.Predict(h, gravity);
  m.Integrate(h);
  return m.BodyPose(body) * point_B;
}

TEST(PointResponse, IsWhatAStepDoesWithAForce) {
  const double h = 1.0 / 60;
  const Vector3 gravity(0, 0.3, -9.81), point_B(0.01, 0.02, -0.01);
  for (const Recovery recovery : {Recovery::kExact, Recovery::kTwist})
    for (const MechanismDef& definition :
         {testing::Chain(3, 0.1, 0.05, 0.4, 0.001, true), testing::Walker(BaseKind::kFixed, 60, 1)}) {
      World::Options options;
      options.recovery = recovery;
      options.reduction.modes = 20;
      World world = testing::MustCreate(definition, options);
      StepOptions step;
      for (int i = 0; i < 5; ++i) world.Step(step);
      const MechanismDynamics& m = world.mechanisms()[0];
      const BodyIndex body = m.model().interfaces.back();
      MechanismState before, after;
      m.Save(before);
      const PointResponse found = RespondAt(m, body, point_B, h, gravity);
      m.Save(after);
      EXPECT_EQ(after.reduced.z, before.reduced.z);
      EXPECT_EQ(found.mass, m.mechanism().total_mass());

      // Without a force to the last bit; with a small one by h² W, to what the pose turns in the step.
      EXPECT_EQ(found.p_free, After(m, body, point_B, h, gravity, Vector3::Zero()));
      EXPECT_TRUE(found.C.isZero(0));
      EXPECT_TRUE(found.W.isApprox(found.W.transpose(), 1e-12));
      for (int axis = 0; axis < 3; ++axis) {
        const Vector3 force = 1e-3 * Vector3::Unit(axis);
        const Vector3 moved = After(m, body, point_B, h, gravity, force) - found.p_free;
        EXPECT_LT((moved - h * h * found.W * force).norm(), 0.05 * h * h * (found.W * force).norm())
            << definition.name << ' ' << axis << ' ' << moved.transpose() << " for "
            << (h * h * found.W * force).transpose();
      }
    }
}

TEST(PointResponse, OfAFreeBody) {
  FreeBody body(testing::BallBody("ball", 0.5, 0.1, Vector3::Zero(), 1));
  const PointResponse found = RespondAt(body, Vector3::Zero(), 0.01, Vector3(0, 0, -10));
  EXPECT_TRUE(found.W.isApprox(2 * Matrix3::Identity(), 1e-12));
  EXPECT_TRUE(found.v_free.isApprox(Vector3(0, 0, -0.1), 1e-12));
  EXPECT_EQ(found.mass, 0.5);
}

}  // namespace
}  // namespace fork1s
