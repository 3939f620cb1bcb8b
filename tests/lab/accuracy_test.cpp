// What docs/accuracy.md claims, on fewer points.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fork1s/reduction/statics.hpp>
#include <lab/accuracy.hpp>
#include <stdexcept>

namespace fork1s {
namespace {

StaticCase Case(const std::string& name) {
  auto cases = MakeStaticCases(FORK1S_SOURCE_DIR "/scenes");
  if (!cases) throw std::runtime_error(cases.error().Text());
  for (StaticCase& c : *cases)
    if (c.name == name) return c;
  throw std::runtime_error("no case " + name);
}

GapCurve Gaps(const std::string& name) {
  auto gaps = MeasureGaps(Case(name), {1, 2, 5, 10, 45});
  if (!gaps) throw std::runtime_error(gaps.error().Text());
  return *gaps;
}

StaticCurve Statics(const std::string& name, double angle_deg, const std::vector<StaticMode>& modes) {
  auto curve = MeasureStatics(Case(name), {angle_deg}, modes);
  if (!curve) throw std::runtime_error(curve.error().Text());
  if (curve->points.size() != 1) throw std::runtime_error(curve->end);
  return *curve;
}

class OfMechanism : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Accuracy, OfMechanism,
                         ::testing::Values("hand", "hexapod", "four-bar", "firemen", "chain"),
                         [](const auto& mechanism) {
                           std::string name = mechanism.param;
                           std::erase(name, '-');
                           return name;
                         });

TEST_P(OfMechanism, GapOfTwistGrowsWithTheSquare) {
  const GapCurve c = Gaps(GetParam());
  // The next term of the series is a tenth of the leading one at 10 degrees; 1.998 to 2.006 were seen.
  EXPECT_NEAR(LogSlope(c.angles_deg, c.twist, 1, 10), 2.0, 0.1);
}

TEST_P(OfMechanism, ExactLeavesNoGap) {
  const bool tree = Case(GetParam()).mechanism->num_constraints() == 0;
  const GapCurve c = Gaps(GetParam());
  // In percent of a link. On trees rounding of poses, 1e-16 times the path's length over that of a link. With
  // loops recovery stops below 1e-10 m: 1e-7 % of the shortest mean link, 0.1 m; four steps from 45 degrees
  // come that far.
  for (double gap : c.exact) EXPECT_LT(gap, tree ? 1e-12 : 1e-6);
}

TEST(Accuracy, SecondMagnusTermLeavesThirdOrderOnTrees) {
  for (const char* name : {"hand", "hexapod", "chain"}) {
    const GapCurve c = Gaps(name);
    EXPECT_NEAR(LogSlope(c.angles_deg, c.second_order, 1, 10), 3.0, 0.1) << name;  // 2.995 to 3.015 were seen
    // By how much at 10 degrees: more than tenfold.
    EXPECT_LT(c.second_order[3], 0.1 * c.twist[3]) << name;
  }
}

TEST(Accuracy, ExactStaticsOfTreesAreThoseOfTheFullMechanism) {
  for (const char* name : {"hand", "hexapod", "chain"}) {
    const StaticCurve c = Statics(name, 30, {StaticMode::kTwist, StaticMode::kExact});
    // Claimed: 0.1 %. Hand and hexapod keep all coordinates, and Newton's last step is below 1e-10 rad of
    // some 0.5; the load column of the chain, 9 of 10, is that of its straight pose.
    EXPECT_LT(c.points[0].percent[1], name == std::string("chain") ? 0.01 : 1e-6) << name;
    EXPECT_GT(c.points[0].percent[0], 1) << name;  // the test can tell: twist is off by 6 % and more
  }
}

TEST(Accuracy, FourBarNeedsItsLoopClosed) {
  const StaticCurve c = Statics("four-bar", 45, {StaticMode::kOpen, StaticMode::kExact});
  const StaticCurve::Point& p = c.points[0];
  EXPECT_GT(p.percent[0], 5);         // 8.7 % was seen, 8.3 % by the prototype
  EXPECT_LT(p.percent[1], 1e-4);      // claimed: 0.1 %; loops closed to 1e-10 m leave 1e-7 % of 0.1 m
  EXPECT_LT(p.loop_gap_mm[1], 1e-3);  // claimed: 1e-3 % of a link of 0.1 m
}

// Two methods to the reduced model's rest: the curve's own equations, and steps until nothing moves.
TEST(Accuracy, SimulationComesToRestWhereTheCurveSaysSo) {
  for (const char* name : {"hand", "four-bar", "chain"}) {
    const StaticCase c = Case(name);
    const StaticCurve curve =
        Statics(name, 10, {StaticMode::kTwist, StaticMode::kExact, StaticMode::kCurved});
    const StaticCurve::Point& p = curve.points[0];
    const auto truth = SolveStatics(*c.mechanism, c.q0, {{c.body, p.force_N * c.direction_R}});
    Kinematics kinematics(*c.mechanism);
    ComputeKinematics(*c.mechanism, truth.q, kinematics);
    const RigidTransform& X_WR = c.mechanism->definition().X_WR;
    const Vector3 at = X_WR * kinematics.X_RB[c.body.u()].translation();
    Scene scene;
    scene.gravity.setZero();
    scene.mechanisms = {c.mechanism->definition()};
    for (std::size_t k = 1; k < 3; ++k) {  // twists draw, and do not step
      SimulationOptions options;
      options.recovery = std::array{Recovery::kTwist, Recovery::kExact, Recovery::kCurved}[k];
      options.step.refresh = false;
      auto simulation = Simulation::Create(scene, options);
      ASSERT_TRUE(simulation) << simulation.error().Text();
      const int body = simulation->FindBody(c.mechanism->body(c.body).name);
      for (int i = 0; i < 1500; ++i) {
        simulation->ApplyWrench(body, p.force_N * (X_WR.rotation() * c.direction_R), Vector3::Zero(),
                                simulation->Pose(body).translation());
        simulation->Step();
      }
      const double percent = 1e5 * (simulation->Pose(body).translation() - at).norm() / p.moved_mm;
      EXPECT_NEAR(percent, p.percent[k], 1e-4) << name << ' ' << k;
    }
  }
}

// Loops that open by the third order of the angle leave an error of second order, where that of twists is of
// first: 0.049 and 0.67 % of the motion at 2 and 10 degrees, with eight loops. The prototype's median: 1.5 %
// at 10.
TEST(Accuracy, CurvedLoopsAreOfSecondOrder) {
  StaticCase c = Case("firemen");
  MechanismDef all = c.mechanism->definition();
  all.modes = 36;
  auto built = BuildMechanism(std::move(all));
  ASSERT_TRUE(built);
  c.mechanism = std::make_shared<const Mechanism>(std::move(*built));
  auto curve = MeasureStatics(c, {2, 10}, {StaticMode::kTwist, StaticMode::kCurved});
  ASSERT_TRUE(curve) << curve.error().Text();
  ASSERT_EQ(curve->points.size(), 2u);
  const auto &a = curve->points[0].percent, &b = curve->points[1].percent;
  EXPECT_LT(b[1], 1);
  EXPECT_GT(b[0], 10 * b[1]);
  EXPECT_LT(std::log(b[0] / a[0]) / std::log(5), 1.3);
  EXPECT_GT(std::log(b[1] / a[1]) / std::log(5), 1.5);
}

TEST(Accuracy, WhatTheFiremenMissIsWhatTheyLeaveOut) {
  StaticCase c = Case("firemen");
  MechanismDef definition = c.mechanism->definition();
  definition.modes = 1000;
  auto built = BuildMechanism(definition);
  ASSERT_TRUE(built) << built.error().Text();
  c.mechanism = std::make_shared<const Mechanism>(std::move(*built));
  auto curve = MeasureStatics(c, {10}, {StaticMode::kExact});
  ASSERT_TRUE(curve) << curve.error().Text();
  ASSERT_EQ(curve->points.size(), 1u);
  // All coordinates: the equilibrium of the full mechanism, loops closed to 1e-10 of about 1 m.
  EXPECT_LT(curve->points[0].percent[0], 1e-6);
}

TEST(Accuracy, ModesBringTheFrequencies) {
  auto cases = MakeFrequencyCases(FORK1S_SOURCE_DIR "/scenes");
  ASSERT_TRUE(cases) << cases.error().Text();
  for (const StaticCase& c : *cases) {
    auto curve = MeasureFrequencies(c, {0, 4, 8}, ModeChoice::kLowest);
    ASSERT_TRUE(curve) << curve.error().Text();
    ASSERT_EQ(curve->points.size(), 3u);
    EXPECT_GT(Worst(curve->points[0]), 20) << c.name;
    EXPECT_LT(Worst(curve->points[1]), 2) << c.name;    // 1.5 was seen
    EXPECT_LT(Worst(curve->points[2]), 0.1) << c.name;  // claimed
  }
}

TEST(Accuracy, SimulationsComeToRestWhereAllJointsWould) {
  auto cases = MakeRestCases(FORK1S_SOURCE_DIR "/scenes");
  ASSERT_TRUE(cases) << cases.error().Text();
  int truncated = 0;
  for (const RestCase& c : *cases) {
    if (c.name != "firemen" && c.name != "random tree 1") continue;
    for (const DeflectionLoad load : kDeflectionLoads) {
      SCOPED_TRACE(c.name + ", " + Name(load));
      auto curve = MeasureRest(c, load, {15});
      ASSERT_TRUE(curve) << curve.error().Text();
      for (const RestCurve::Point& p : curve->points) {
        EXPECT_LT(p.speed, 1e-9);
        EXPECT_LT(p.interface_percent, 0.1);  // claimed
        EXPECT_LT(p.inside, 1e-3);            // claimed
        truncated += p.size < curve->coordinates ? 1 : 0;
      }
    }
  }
  EXPECT_EQ(truncated, 7);  // all; the firemen have no servos
}

TEST(Accuracy, HalfTheStepHalvesTheErrorOfAMotion) {
  auto cases = MakeTransientCases(FORK1S_SOURCE_DIR "/scenes");
  ASSERT_TRUE(cases) << cases.error().Text();
  const TransientCase& chain = cases->back();
  auto curve = MeasureTransient(chain, 3);
  ASSERT_TRUE(curve) << curve.error().Text();
  for (std::size_t k = 1; k < curve->points.size(); ++k) {
    // First order; 1.87 to 1.95 were seen, since the next term of the error has the other sign.
    EXPECT_NEAR(curve->points[k - 1].reduced_percent / curve->points[k].reduced_percent, 2, 0.25);
    EXPECT_NEAR(curve->points[k - 1].full_percent / curve->points[k].full_percent, 2, 0.25);
  }
}

}  // namespace
}  // namespace fork1s
