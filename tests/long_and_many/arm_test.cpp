// A continuum arm of many hinges against the elastic rod that it stands for, and against the full model.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <continuum_arm.hpp>
#include <fork1s/constraints/material.hpp>
#include <fork1s/study/compare.hpp>

namespace fork1s::examples {
namespace {

Simulation Start(const Scene& scene) {
  auto simulation = Simulation::Create(scene);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

void Advance(Simulation& simulation, double seconds) {
  const auto steps = static_cast<int>(seconds / simulation.dt() + 0.5);
  for (int i = 0; i < steps; ++i) {
    const StepReport report = simulation.Step();
    ASSERT_TRUE(report.finite) << i;
    ASSERT_TRUE(report.IsSolved()) << i;
    ASSERT_LT(report.max_penetration, 5e-4) << i;
  }
}

// End of the arm, where its ball has its centre.
Vector3 Tip(const Simulation& simulation, const ContinuumArm& arm) {
  return simulation.Pose("link" + std::to_string(arm.joints - 1)) *
         Vector3(0.5 * arm.length / arm.joints, 0, 0);
}

// A rod in stretches of three links has the curvature of each lumped at its middle: second order in their
// length.
double Lumping(const ContinuumArm& arm) { return std::pow(3.0 / arm.joints, 2); }

using Joints = testing::TestWithParam<int>;
class FreeArm : public Joints {};

TEST_P(FreeArm, DroopsAsACantilever) {
  ContinuumArm arm;
  arm.joints = GetParam();
  arm.table = -1;
  arm.ball = false;
  Simulation simulation = Start(ContinuumArmScene(arm));
  Advance(simulation, 3);
  const double droop = arm.mass * 9.81 * std::pow(arm.length, 3) / (8 * arm.bending);
  // Slopes of 1/60: what small deflections leave out is of their square.
  EXPECT_NEAR(Tip(simulation, arm).z(), -droop, (2 * Lumping(arm) + 5e-4) * droop);
}

TEST_P(FreeArm, CurlsIntoAnArc) {
  ContinuumArm arm;
  arm.joints = GetParam();
  arm.table = -1;
  arm.ball = false;
  Scene scene = ContinuumArmScene(arm);
  scene.gravity.setZero();
  Simulation simulation = Start(scene);
  const double curvature = 2;  // 1/m: the tip turns by 103 degrees
  simulation.SetControl("curl", curvature);
  Advance(simulation, 4);
  const double turn = curvature * arm.length;
  const Vector3 expected(std::sin(turn) / curvature, 0, (std::cos(turn) - 1) / curvature);
  EXPECT_LT((Tip(simulation, arm) - expected).norm(), Lumping(arm) * arm.length);
}

INSTANTIATE_TEST_SUITE_P(Counts, FreeArm, testing::Values(30, 90, 999));

struct Case {
  int joints;
  double stiffness;
};
std::ostream& operator<<(std::ostream& out, const Case& c) {
  return out << c.joints << " joints x" << c.stiffness;
}

class ProppedArm : public testing::TestWithParam<Case> {};

// Clamped at one end and propped at the other, a uniform rod puts 3/8 of its weight on the prop, stiff or
// not.
TEST_P(ProppedArm, LeansOnTheTableWithThreeEighthsOfItsWeight) {
  ContinuumArm arm;
  arm.joints = GetParam().joints;
  arm.stiffness_scale = GetParam().stiffness;
  arm.table = -arm.radius;
  arm.ball = false;
  arm.friction = 0;  // below the axis it would bend the arm
  Simulation simulation = Start(ContinuumArmScene(arm));
  Advance(simulation, 2);
  double force = 0, depth = 0;
  for (const ContactRecord& c : simulation.world().contacts()) {
    force += c.impulse(0) / simulation.dt();
    depth = std::max(depth, -c.point.gap);
  }
  // The table gives; for the tip that is worth 3 E I / L³ a metre.
  const double tip = 3 * arm.bending * arm.stiffness_scale / std::pow(arm.length, 3);
  const double expected = 0.375 * arm.mass * 9.81 - tip * depth;
  EXPECT_LE(depth, 1.01 * expected / ContactMaterial().stiffness);
  EXPECT_NEAR(force, expected, 2 * Lumping(arm) * expected);
}

INSTANTIATE_TEST_SUITE_P(Arms, ProppedArm,
                         testing::Values(Case{90, 1}, Case{90, 100}, Case{999, 1}, Case{999, 100}));

class SweepingArm : public testing::TestWithParam<Case> {};

TEST_P(SweepingArm, PressesAndStrikesWithoutTrouble) {
  ContinuumArm arm;
  arm.joints = GetParam().joints;
  arm.stiffness_scale = GetParam().stiffness;
  Simulation simulation = Start(ContinuumArmScene(arm));
  const ControlTrack motion = ContinuumArmMotion();
  const Vector3 ball = simulation.Pose("ball").translation();
  double pressed = 0;
  while (simulation.time() < motion.times.back() - 1e-9) {
    motion.Apply(simulation.time() + simulation.dt(), simulation);
    const StepReport report = simulation.Step();
    ASSERT_TRUE(report.finite) << simulation.time();
    EXPECT_TRUE(report.IsSolved()) << simulation.time();
    EXPECT_LT(report.max_penetration, 5e-4) << simulation.time();
    // Neither the press nor the blow throws the tip: it keeps to the speed of its set-points, 0.3 m/s.
    EXPECT_LT(simulation.Velocity(arm.joints).tail<3>().norm(), 0.6) << simulation.time();
    if (std::abs(simulation.time() - 1.2) < 1e-9)
      for (const ContactRecord& c : simulation.world().contacts())
        pressed = std::max(pressed, c.impulse(0) / simulation.dt());
  }
  // 3 E I / L³ for every metre that the table holds the tip above where its tendons would have it: 70 mm
  // below the root, and by the weight's 11 mm over the stiffness more; 50 mm are free.
  const double rate = 3 * arm.bending * arm.stiffness_scale / std::pow(arm.length, 3);
  const double droop = arm.mass * 9.81 * std::pow(arm.length, 3) / (8 * arm.bending * arm.stiffness_scale);
  const double below = 0.07 - 0.05 + droop;
  EXPECT_NEAR(pressed, rate * below, 0.05 * rate * below);
  EXPECT_GT((simulation.Pose("ball").translation() - ball).norm(), 0.1) << "struck";
}

INSTANTIATE_TEST_SUITE_P(Arms, SweepingArm,
                         testing::Values(Case{90, 1}, Case{90, 100}, Case{1000, 1}, Case{1000, 100}));

TEST(Arm, FollowsTheFullModel) {
  ContinuumArm arm;
  arm.joints = 36;
  ImportedScene imported;
  imported.scene = ContinuumArmScene(arm);
  CompareOptions options;
  options.controls = ContinuumArmMotion();
  options.time = 2.2;  // the ball is struck at 1.8 s
  options.refinements = 0;
  options.integrator = Integrator::kEuler;  // the same rule on both sides: what differs is the reduction's
  auto comparison = Compare(imported, options);
  ASSERT_TRUE(comparison.has_value()) << comparison.error().Text();
  // The tip moves by 160 mm. Where dry friction lets it go depends on what is left of the interior's motion.
  EXPECT_LT(comparison->interface.front().rms_mm, 1);
  EXPECT_LT(comparison->interface.front().max_mm, 2);
}

}  // namespace
}  // namespace fork1s::examples
