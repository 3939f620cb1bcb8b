// The small scenes stand still, hold and stay closed, at their own stiffness and far above it.
#include <cmath>
#include <fork1s/reduction/reduced_model.hpp>
#include <memory>

#include "linalg/spectrum.hpp"
#include "support.hpp"

namespace fork1s::examples {
namespace {

class Scaled : public testing::TestWithParam<double> {
 protected:
  ImportOptions Options() const {
    ImportOptions options;
    options.stiffness_scale = GetParam();
    return options;
  }
};

using Hexapod = Scaled;

TEST_P(Hexapod, StandsStill) {
  Simulation simulation = Start(Load("hexapod", Options()).scene);
  const Passage settling = Advance(simulation, 2);
  EXPECT_TRUE(settling.finite);
  EXPECT_LT(settling.penetration, 5e-4);
  const RigidTransform before = simulation.Pose("trunk");
  const Passage rest = Advance(simulation, 2);
  EXPECT_TRUE(rest.finite);
  EXPECT_EQ(rest.unconverged, 0);
  EXPECT_EQ(rest.contacts, 6);
  EXPECT_LT((simulation.Pose("trunk").translation() - before.translation()).norm(), 1e-5);
  EXPECT_LT(LogRotation(before.rotation().transpose() * simulation.Pose("trunk").rotation()).norm(), 1e-4);
  EXPECT_GT(simulation.Pose("trunk").translation().z(), 0.08);  // upright: it starts at 0.092

  double carried = 0;
  for (const ContactRecord& c : simulation.world().contacts())
    carried += (c.point.frame.transpose() * c.impulse).z() / simulation.dt();
  double mass = 0;
  for (const BodyDef& body : simulation.scene().mechanisms[0].bodies) mass += body.inertia.mass;
  EXPECT_NEAR(std::abs(carried), mass * 9.81, 1e-3 * mass * 9.81);
}

INSTANTIATE_TEST_SUITE_P(Gains, Hexapod, testing::Values(1, 100, 1e4));

using Gripper = Scaled;

TEST_P(Gripper, ClosesOnTheCubeWithItsLoopsClosed) {
  Simulation simulation = Start(Load("fourbar_gripper", Options()).scene);
  // Crank angle at which the pads touch the cube, what the servo adds against the flexures of the three
  // moving bars of a jaw, and a squeeze that is the same force at any gain up to what the slop of contacts
  // may take of it.
  const double reach = std::asin(0.008 / 0.05);
  const double squeeze = reach * (2 + 3 * 0.05) / 2 + 0.06 / GetParam() + 1e-4;
  for (int i = 1; i <= 60; ++i) {
    for (const char* side : {"left_grip", "right_grip"}) simulation.SetControl(side, squeeze * i / 60.0);
    const Passage run = Advance(simulation, simulation.dt());
    ASSERT_TRUE(run.finite) << i;
    EXPECT_LT(run.gap, 1e-5) << i;
    EXPECT_LT(run.penetration, 1e-3) << i;
  }
  Advance(simulation, 1);
  const Vector3 before = simulation.Pose("cube").translation();
  const Passage rest = Advance(simulation, 2);
  EXPECT_TRUE(rest.finite);
  EXPECT_EQ(rest.unconverged, 0);
  EXPECT_LT(rest.gap, 1e-5);
  EXPECT_LT((simulation.Pose("cube").translation() - before).norm(), 1e-5);
  double grip = 0;
  for (const ContactRecord& c : simulation.world().contacts())
    if (std::abs(c.point.frame(0, 0)) > 0.9) grip += c.impulse(0) / simulation.dt();
  EXPECT_GT(grip, 1) << "both pads press";
}

INSTANTIATE_TEST_SUITE_P(Gains, Gripper, testing::Values(1, 100, 1e4));

using Arm = Scaled;

TEST_P(Arm, RestsWhereItIs) {
  Simulation simulation = Start(Load("two_link_arm", Options()).scene);
  const Passage rest = Advance(simulation, 2);
  EXPECT_TRUE(rest.finite);
  EXPECT_EQ(rest.unconverged, 0);
  EXPECT_LT(rest.speed, 1e-12);  // gravity stands across both axes
}

INSTANTIATE_TEST_SUITE_P(Gains, Arm, testing::Values(1, 100, 1e4));

TEST(ArmUndamped, VibratesAtItsKnownFrequencies) {
  // det(K - ω² M) = 0 with M = [[5/3, 1/3], [1/3, 1/3]], K = 100 I: uniform rods with the elbow at a right
  // angle.
  ImportedScene imported = Load("two_link_arm");
  for (JointDef& joint : imported.scene.mechanisms[0].joints) joint.freedoms[0].damping = 0;
  auto mechanism = BuildMechanism(imported.scene.mechanisms[0]);
  ASSERT_TRUE(mechanism.has_value()) << mechanism.error().Text();
  auto model = Reduce(std::make_shared<const Mechanism>(std::move(*mechanism)), VectorX::Zero(2));
  ASSERT_TRUE(model.has_value()) << model.error().Text();
  ASSERT_EQ(model->size(), 2);
  const VectorX squares = EigenvaluesOf(model->K_r.asDiagonal(), model->M);
  EXPECT_NEAR(std::sqrt(squares(0)), 7.5693, 1e-4);
  EXPECT_NEAR(std::sqrt(squares(1)), 19.8168, 1e-4);
}

}  // namespace
}  // namespace fork1s::examples
