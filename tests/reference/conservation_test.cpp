// Momentum is kept, energy never grows, and a free body turns as in the reduced simulator.
#include <cmath>
#include <fork1s/sim/simulation.hpp>

#include "support.hpp"

namespace fork1s::reference_test {
namespace {

TEST(Momentum, OfAFloatingMechanismIsKept) {
  Scene scene = Of(testing::Walker(BaseKind::kFloating, 20, 0.2));
  scene.mechanisms[0].interfaces.clear();
  Vector6 V_R;
  V_R << 1, 3, -2, 0.5, 0.2, -0.4;
  StartAt(scene, VectorX::Zero(8), VectorX::LinSpaced(8, -2, 3), V_R);
  FullSimulation s = Start(scene, 1.0 / 60);
  const Vector6 before = s.Momentum();
  const double energy = s.KineticEnergy();
  Advance(s, 2);
  // Every body's momentum is carried to its new pose without loss; what is left is the tolerance of Newton,
  // 1e-9 of a length a step, over 120 steps of 1/60 s.
  EXPECT_LT((s.Momentum() - before).norm(), 1e-5 * before.norm());
  EXPECT_LT(s.Energy(), energy);
}

Scene Tumbling() {
  Scene scene;
  scene.gravity.setZero();
  FreeBodyDef body;
  body.name = "brick";
  body.inertia = testing::Brick(2, Vector3(0.1, 0.05, 0.02));
  body.inertia.center = Vector3(0.03, 0, 0.01);
  scene.free_bodies = {body};
  KeyframeDef key;
  key.free_bodies.push_back({RigidTransform(), Vector3(1, 6, 0.5), Vector3(0.3, 0, 0)});
  scene.keyframes = {key};
  return scene;
}

TEST(FreeBody, TurnsAsInTheReducedSimulator) {
  FullSimulation s = Start(Tumbling(), 1.0 / 60);
  SimulationOptions options;
  options.dt = 1.0 / 60;
  options.initial_keyframe = 0;
  options.step.integrator = Integrator::kEuler;
  auto reduced = Simulation::Create(Tumbling(), options);
  ASSERT_TRUE(reduced);
  const double energy = s.KineticEnergy();
  for (int i = 0; i < 120; ++i) {
    ASSERT_TRUE(s.Step().converged);
    reduced->Step();
  }
  // Both solve the same equation, to 1e-9 and 1e-6 of the motion in a step.
  EXPECT_LT(s.KineticEnergy(), energy);
  EXPECT_LT((s.Pose(0).rotation() - reduced->Pose(0).rotation()).norm(), 1e-6);
  EXPECT_LT((s.Pose(0).translation() - reduced->Pose(0).translation()).norm(), 1e-7);
}

TEST(FreeBody, KeepsItsMomentum) {
  FullSimulation s = Start(Tumbling(), 1.0 / 60);
  const Vector6 before = s.Momentum();
  Advance(s, 1);
  EXPECT_LT((s.Momentum() - before).norm(), 1e-7 * before.norm());
}

class Energy : public ::testing::TestWithParam<double> {};

TEST_P(Energy, NeverGrowsHoweverStiff) {
  const double k = GetParam();
  Scene scene = Of(testing::Chain(6, 0.1, 0.2, k, 0.001 * k, true), Vector3(0, 0, -9.81));
  StartAt(scene, VectorX::LinSpaced(6, -0.2, 0.2), VectorX::Constant(6, 1));
  FullSimulation s = Start(scene, 1.0 / 60);
  double before = s.Energy();
  const double scale = std::abs(before) + 1;
  for (int i = 0; i < 120; ++i) {
    ASSERT_TRUE(s.Step().converged) << i;
    const double now = s.Energy();
    // What the tolerance of 1e-9 of a length may give: k q δq.
    EXPECT_LE(now, before + 1e-7 * scale) << i;
    before = now;
  }
}

INSTANTIATE_TEST_SUITE_P(Stiffness, Energy, ::testing::Values(1.0, 1e3, 1e6));

TEST(DrivenBase, CarriesItsBodiesAlong) {
  Scene scene = Of(testing::Walker(BaseKind::kDriven, 20, 0.5));
  scene.mechanisms[0].interfaces.clear();
  FullSimulation s = Start(scene, 0.01);
  const int turn = s.FindControl("base.rz"), shift = s.FindControl("base.x");
  ASSERT_GE(turn, 0);
  ASSERT_GE(shift, 0);
  for (int i = 1; i <= 100; ++i) {
    VectorX u = s.controls();
    u(turn) = 0.01 * i;
    u(shift) = 0.002 * i;
    s.SetControls(u);
    ASSERT_TRUE(s.Step().converged);
  }
  EXPECT_LT((s.Pose(0).translation() - Vector3(0.2, 0, 0)).norm(), 1e-12);
  EXPECT_NEAR(s.Velocity(0)(2), 1, 1e-9);  // rad/s
  // Turning steadily, the legs lag and stretch little; all joints hold.
  EXPECT_LT(s.JointGaps().front().gap, 1e-12);
  EXPECT_NEAR(s.Velocity(1)(2), 1, 0.2);
}

TEST(Robustness, PushesThatAreAbsurdAreReported) {
  FullSimulation s = Start(Of(testing::Chain(3, 0.1, 0.1, 1)), 1.0 / 60);
  s.ApplyWrench(1, Vector3(0, 1e308, 0), Vector3::Zero(), Vector3(1e3, 0, 0));  // its moment overflows
  const FullStepReport report = s.Step();
  EXPECT_FALSE(report.finite);
  EXPECT_FALSE(report.converged);
  EXPECT_TRUE(s.Pose(1).IsFinite());
  EXPECT_EQ(s.steps(), 0);
  // The push is forgotten; the state is that before it.
  EXPECT_TRUE(s.Step().converged);
  EXPECT_EQ(s.Energy(), 0);
}

}  // namespace
}  // namespace fork1s::reference_test
