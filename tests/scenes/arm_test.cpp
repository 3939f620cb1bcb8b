// An arm whose fist holds a tool by five loops: blows and an insertion.
#include "run.hpp"

namespace fork1s::examples {
namespace {

class Hammer : public ::testing::TestWithParam<double> {};

TEST_P(Hammer, StrikesAnvilAndNail) {
  SceneRun run("hammer", GetParam());
  // The nail swings at 240 Hz. Backward Euler brings it to its place at once; two stages end anywhere in its
  // swing.
  run.simulation().step_options().integrator = Integrator::kEuler;
  Course course = run.Until(1);
  EXPECT_GT(run.Position("hammer").z(), 0.4) << "raised";
  course = run.Until(1.7);
  EXPECT_GT(course.force_max, 50) << "on the anvil";
  EXPECT_LT(course.penetration,
            8e-4);  // the head's arc within a step; 0.67 mm was seen, 0.17 at half the step

  run.Until(3);
  const double spring = 2e5 * GetParam(), rest = run.Position("nail").z();
  double deepest = 0, force = 0;
  course = run.Until(3.6, [&](const StepReport&) {
    deepest = std::max(deepest, rest - run.Position("nail").z());
    force = std::max(force, -ContactForce(run.simulation(), "nail").z());
  });
  EXPECT_GT(force, 30) << "on the nail";
  // At 60 steps a second the nail follows its spring: its mass and damper add 3 %.
  EXPECT_NEAR(deepest * spring, force, 0.05 * force);
  EXPECT_LT(course.gap, 1e-5);

  course = run.Until(8);
  EXPECT_TRUE(course.finite);
  EXPECT_EQ(course.unconverged, 0);
  EXPECT_LT(run.simulation().KineticEnergy(), 1e-4) << "comes to rest";
}

INSTANTIATE_TEST_SUITE_P(Gains, Hammer, ::testing::Values(1, 100));

// Peg in the frame of the hole: 1 mm beside the path of the drawn peg, turned by 2 degrees about y.
struct PegPlace {
  Vector3 tip;    // m, the lowest point of the axis, 10 mm above the end of the round nose
  Vector3 along;  // unit vector from there up the axis
  explicit PegPlace(const Simulation& simulation) {
    const RigidTransform X_WH(ExpRotation(Vector3(0, 2 * 3.14159265358979 / 180, 0)),
                              Vector3(0.431, 0.03, 0));
    const RigidTransform X_HP = X_WH.inverse() * simulation.Pose("peg");
    tip = X_HP * Vector3(0, 0, -0.15);
    along = X_HP.rotation() * Vector3::UnitZ();
  }
  double Depth() const { return 0.01 - tip.z(); }  // m, of the end of the nose
  double Degrees() const { return std::acos(along.z()) * 180 / 3.14159265358979; }
  Vector3 Mouth() const { return tip - tip.z() / along.z() * along; }  // where the axis meets the mouth
  /// Largest distance of the axis from the middle of the hole, along its sides, where it is inside.
  double OffMiddle() const {
    double off = 0;
    for (const Vector3& p : {tip, Mouth()}) off = std::max({off, std::abs(p.x()), std::abs(p.y())});
    return off;
  }
};

class PegInHole : public ::testing::TestWithParam<double> {};

TEST_P(PegInHole, EndsInserted) {
  SceneRun run("peg_in_hole", GetParam());
  run.Until(1.4);
  const PegPlace above(run.simulation());
  EXPECT_LT(above.Depth(), 0);
  EXPECT_NEAR(above.Degrees(), 2, 0.05);
  EXPECT_NEAR(above.Mouth().x(), -1e-3, 1e-4) << "aims beside the hole by ten times its clearance";

  Course course = run.Until(4.5);
  EXPECT_TRUE(course.finite);
  EXPECT_LT(course.gap, 1e-5);
  EXPECT_LT(course.penetration, 1e-4);  // slop

  const Vector3 before = run.Position("peg");
  course = run.Until(5);
  EXPECT_EQ(course.unconverged, 0);
  EXPECT_LT((run.Position("peg") - before).norm(), 1e-5) << "rests";
  const PegPlace inside(run.simulation());
  EXPECT_GT(inside.Depth(),
            0.035);  // the path ends at 45 mm less 10 mm above; friction takes some millimetres
  // Clearance 0.1 mm each way and the slop of contact; within it the peg can lean by 0.4 mm in 28.
  EXPECT_LT(inside.OffMiddle(), 2e-4);
  EXPECT_LT(inside.Degrees(), 0.8);
}

INSTANTIATE_TEST_SUITE_P(Gains, PegInHole, ::testing::Values(1, 100));

// The same with a peg that fingertips hold by friction, frozen and let go on the way.
class PegGrasp : public ::testing::TestWithParam<double> {};

TEST_P(PegGrasp, IsInsertedWithContactsFrozenOnTheWay) {
  SceneRun run("peg_grasp", GetParam(), 1, "peg_in_hole");
  run.Until(0.5);
  const RigidTransform before = run.simulation().Pose("peg");
  auto set = run.simulation().SetFidelity({DetailLevel::kObject, -1, Recovery::kExact});
  ASSERT_TRUE(set) << set.error().Text();
  EXPECT_LT((run.simulation().Pose("peg").translation() - before.translation()).norm(), 1e-12);
  EXPECT_GE(run.simulation().frozen_grasps()[0].contacts.size(), 6u) << "fingertips and pads";

  // Down into the hole as one body.
  double use = 0;
  Course course = run.Until(4.5, [&](const StepReport&) {
    for (const FrozenContactForce& f : run.simulation().FrozenContactForces()) use = std::max(use, f.use);
  });
  EXPECT_TRUE(course.finite);
  EXPECT_EQ(course.unconverged, 0);
  EXPECT_LT(course.gap, 1e-5);
  EXPECT_LT(course.penetration, 1e-4);  // slop
  EXPECT_GT(PegPlace(run.simulation()).Depth(), 0.03);

  // Fingers take over again.
  const RigidTransform inside = run.simulation().Pose("peg");
  ASSERT_TRUE(run.simulation().SetFidelity({}));
  EXPECT_LT((run.simulation().Pose("peg").translation() - inside.translation()).norm(), 1e-12);
  course = run.Until(5);
  EXPECT_TRUE(course.finite);
  // Fingertips take over what frozen contacts bore and may slide by a fraction of a millimetre: 0.25 mm at
  // 1/60 s, 0.06 at 1/240 s.
  EXPECT_LT((run.simulation().Pose("peg").translation() - inside.translation()).norm(), 5e-4)
      << "stays inside";
  EXPECT_LT(run.simulation().KineticEnergy(), 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Gains, PegGrasp, ::testing::Values(1, 100));

}  // namespace
}  // namespace fork1s::examples
