// A hexapod, a quadruped and two bipeds stand for a minute at 1/60 s, on flat and on uneven ground, at their
// own gains and far above them.
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include "machines.hpp"

namespace fork1s::examples {
namespace {

// s. Leaf springs swing for minutes, since only joints are damped, and feet on uneven ground rock with them:
// between 40 s and 100 s by 2.7 mm (Digit) and 0.8 mm (Cassie, gains times 100) by steps of 1/240 s.
constexpr double kSettling = 40, kTime = 100;

// ANYmal's feet bear moments (condim 6).
bool BearsMomentsOnUnevenGround(const Case& c) {
  return c.robot == LeggedRobot::kAnymal && c.ground == LeggedGround::kUneven;
}

// m, a quarter more than by steps of 1/240 s.
double MostFootMotion(const Case& c) {
  if (c.ground == LeggedGround::kUneven && c.robot == LeggedRobot::kDigit && c.gain_scale == 1) return 3.4e-3;
  if (c.ground == LeggedGround::kUneven && c.robot == LeggedRobot::kCassie && c.gain_scale > 1) return 1e-3;
  return 1e-4;
}

class Stands : public testing::TestWithParam<Case> {};

TEST_P(Stands, ForAMinute) {
  if (const std::string why = WhyMissing(GetParam().robot); !why.empty()) GTEST_SKIP() << why;
  const LeggedScene legged = Load(GetParam());
  Simulation simulation = Start(legged.imported.scene, StandingOptions(legged));
  const StandMeasurement m = Stand(simulation, legged, kSettling, kTime);
  EXPECT_EQ(m.steps, 6000);
  EXPECT_TRUE(m.finite);
  EXPECT_EQ(m.unconverged, 0);
  EXPECT_LT(m.foot_motion, MostFootMotion(GetParam()));
  // What stands still keeps the rounding of its velocities.
  EXPECT_LT(m.swing[1], std::max(m.swing[0], 1e-12)) << "swings die down";
  EXPECT_LT(m.joint_gap, 1e-5);
  EXPECT_LT(m.penetration, 1.1e-4) << "slop of contact, and a tenth of it";
  // A stiff ANYmal balances on two feet across, which bear moments; points that bear none need a third.
  EXPECT_GE(m.contacts_min, BearsMomentsOnUnevenGround(GetParam()) ? 2 : 3);
  // The ground differs in height by up to 40 mm under feet 0.25 m apart, or 20 mm under feet 0.2 m apart.
  EXPECT_LT(m.lean, GetParam().ground == LeggedGround::kFlat ? 0.002 : 0.15);
}

std::vector<Case> AllCases() {
  std::vector<Case> cases;
  for (LeggedRobot robot :
       {LeggedRobot::kHexapod, LeggedRobot::kAnymal, LeggedRobot::kCassie, LeggedRobot::kDigit})
    for (LeggedGround ground : {LeggedGround::kFlat, LeggedGround::kUneven})
      for (double scale : {1.0, 100.0}) cases.push_back({robot, ground, scale});
  return cases;
}
INSTANTIATE_TEST_SUITE_P(Machines, Stands, testing::ValuesIn(AllCases()));

// The same as the program does it without being told anything.
class StandsByDefault : public testing::TestWithParam<Case> {};

TEST_P(StandsByDefault, ForAMinute) {
  if (const std::string why = WhyMissing(GetParam().robot); !why.empty()) GTEST_SKIP() << why;
  const LeggedScene legged = Load(GetParam());
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    SCOPED_TRACE(Name(integrator));
    SimulationOptions options;
    options.initial_keyframe = legged.imported.initial_keyframe;
    options.step.integrator = integrator;
    Simulation simulation = Start(legged.imported.scene, options);
    const StandMeasurement m = Stand(simulation, legged, kSettling, kTime);
    EXPECT_TRUE(m.finite);
    EXPECT_EQ(m.unconverged, 0);
    EXPECT_LT(m.foot_motion, 1e-4);
  }
}

INSTANTIATE_TEST_SUITE_P(Machines, StandsByDefault,
                         testing::Values(Case{LeggedRobot::kHexapod, LeggedGround::kFlat},
                                         Case{LeggedRobot::kHexapod, LeggedGround::kUneven},
                                         Case{LeggedRobot::kAnymal, LeggedGround::kFlat},
                                         Case{LeggedRobot::kAnymal, LeggedGround::kUneven}));

// Set-points from statics against the simulation: the pose that bears the weight is where it comes to rest.
class Biped : public testing::TestWithParam<Case> {};

TEST_P(Biped, RestsInThePoseThatStaticsFound) {
  if (const std::string why = WhyMissing(GetParam().robot); !why.empty()) GTEST_SKIP() << why;
  const LeggedScene legged = Load(GetParam());
  Simulation simulation = Start(legged.imported.scene, StandingOptions(legged));
  const RigidTransform before = simulation.Pose(legged.trunk);
  const StandMeasurement m = Stand(simulation, legged, kSettling, kSettling + 1);
  EXPECT_TRUE(m.finite);
  // Shares of the weight are free to differ where a leg's own springs say so: Digit's legs are drawn 3 mm
  // unlike each other, and its hips yield by a millimetre for it.
  EXPECT_LT((simulation.Pose(legged.trunk).translation() - before.translation()).norm(), 1e-3);
  EXPECT_LT(m.lean, 0.002);
}

INSTANTIATE_TEST_SUITE_P(Bipeds, Biped,
                         testing::Values(Case{LeggedRobot::kCassie}, Case{LeggedRobot::kDigit}));

// What stands because its servos are stiff falls where they are not: m g h = 290 N m/rad, and a twentieth of
// the gains leaves 50 N m/rad in each of the joints that bear it one after the other.
TEST(Cassie, FallsWithoutTheStiffnessToStand) {
  if (const std::string why = WhyMissing(LeggedRobot::kCassie); !why.empty()) GTEST_SKIP() << why;
  const LeggedScene legged = Load({LeggedRobot::kCassie, LeggedGround::kFlat, 0.05});
  Simulation simulation = Start(legged.imported.scene, StandingOptions(legged));
  const StandMeasurement m = Stand(simulation, legged, kSettling, kTime);
  EXPECT_TRUE(m.finite);
  EXPECT_GT(m.lean, 1);
  EXPECT_LT(m.joint_gap, 1e-5);
}

TEST(Digit, HasItsRodsTogether) {
  if (const std::string why = WhyMissing(LeggedRobot::kDigit); !why.empty()) GTEST_SKIP() << why;
  const LeggedScene legged = Load({LeggedRobot::kDigit});
  const Simulation simulation = Start(legged.imported.scene, StandingOptions(legged));
  for (int i = 1; i <= 6; ++i) {
    const std::string rod = "closedloop" + std::to_string(i);
    const RigidTransform E = simulation.Pose(rod + "_A").inverse() * simulation.Pose(rod + "_B");
    EXPECT_LT(E.translation().norm(), 1e-9) << rod;
    EXPECT_LT(LogRotation(E.rotation()).norm(), 1e-8) << rod;
  }
  // Three hip joints, knee and two cranks a leg, and the base.
  EXPECT_EQ(simulation.world().mechanisms()[0].num_velocities(), 18);
}

TEST(Models, AreNamedWhereTheyAreMissing) {
  LeggedOptions options = Folders();
  options.models = "no/such/folder";
  const auto legged = LoadLegged(LeggedRobot::kAnymal, options);
  ASSERT_FALSE(legged);
  EXPECT_EQ(legged.error().code, ErrorCode::kFile);
  EXPECT_NE(legged.error().Text().find("no/such/folder/anybotics_anymal_c"), std::string::npos);
}

}  // namespace
}  // namespace fork1s::examples
