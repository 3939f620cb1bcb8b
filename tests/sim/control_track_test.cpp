// Values of controls over time.
#include <gtest/gtest.h>
#include <fork1s/sim/simulation.hpp>
#include <mechanisms.hpp>

namespace fork1s {
namespace {

Simulation Servo() {
  MechanismDef definition = testing::Chain(2, 0.1, 0.1, 5, 0.1);
  for (int i = 0; i < 2; ++i) {
    ControlDef control;
    control.name = i == 0 ? "first" : "second";
    control.terms.emplace_back(FreedomRef{JointIndex(i), 0}, 1.0);
    control.gain = 5;
    control.is_setpoint = true;
    control.upper = 1;
    definition.controls.push_back(control);
  }
  Scene scene;
  scene.mechanisms.push_back(definition);
  auto simulation = Simulation::Create(scene);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

TEST(ControlTrack, LinearBetweenRowsAndHeldOutside) {
  Simulation s = Servo();
  ControlTrack track;
  track.names = {"second", "first"};
  track.times = {1, 2, 4};
  track.rows = {{0.1, 0}, {0.3, -1}, {-0.1, 1}};
  const double expected[][3] = {// time, second, first
                                {-5, 0.1, 0}, {0, 0.1, 0},     {1, 0.1, 0},  {1.5, 0.2, -0.5}, {2, 0.3, -1},
                                {3, 0.1, 0},  {3.5, 0.0, 0.5}, {4, -0.1, 1}, {100, -0.1, 1}};
  for (const auto& row : expected) {
    track.Apply(row[0], s);
    EXPECT_NEAR(s.controls()(s.FindControl("second")), row[1], 1e-15) << row[0];
    EXPECT_NEAR(s.controls()(s.FindControl("first")), row[2], 1e-15) << row[0];
  }
}

// A driven base: what carries others has no jumps of velocity.
TEST(ControlTrack, CornersOfADrivenPathAreRounded) {
  MechanismDef definition = testing::Chain(2, 0.1, 0.1, 5, 0.1);
  definition.base = BaseKind::kDriven;
  Scene scene;
  scene.mechanisms.push_back(definition);
  auto made = Simulation::Create(scene);
  ASSERT_TRUE(made);
  Simulation& s = *made;
  const int x = s.FindControl(definition.bodies[0].name + ".x");
  ASSERT_TRUE(x >= 0 && s.DrivesBase(x));
  ControlTrack track;
  track.names = {s.control_names()[static_cast<std::size_t>(x)]};
  track.times = {0, 0.5, 1, 1.02, 1.04, 2};
  track.rows = {{0}, {1}, {1}, {0.9}, {0.7}, {0.7}};
  const auto at = [&](double t) {
    track.Apply(t, s);
    return s.controls()(x);
  };
  constexpr double kHalf = 1.0 / 60;  // s, at most, on either side of a row
  for (const double t : {0.1, 0.25, 0.5 - kHalf, 0.5 + kHalf, 0.7, 1.5}) {
    const double line = t < 0.5 ? 2 * t : t < 1.04 ? 1 : 0.7;
    EXPECT_NEAR(at(t), line, 1e-12) << t;  // away from corners the lines
  }
  EXPECT_EQ(at(0), 0);                                 // it starts where it is
  EXPECT_NEAR(at(0.5), 1 - 2 * 2 * kHalf / 8, 1e-12);  // a parabola that is as wide as 1/30 s
  for (double t = 0.013; t < 2.1; t += 0.0037) {
    const double slope = (at(t + 1e-6) - at(t - 1e-6)) / 2e-6;
    at(t);
    EXPECT_NEAR(s.base_rates()(0), slope, 1e-3) << t;
  }
  s.SetControl(x, 0);
  EXPECT_TRUE(std::isnan(s.base_rates()(0)));  // of a value that is no sample of a known path
  // A second difference over 1 ms: bounded by the change of slope over the width, nowhere a jump.
  constexpr double d = 1e-3;
  for (double t = 0.01; t < 2.1; t += 0.37 * d) {
    const double bend = std::abs(at(t + d) - 2 * at(t) + at(t - d)) / (d * d);
    EXPECT_LT(bend, t < 0.9 ? 2 / (2 * kHalf) + 1e-6 : 12 / 0.02 + 1e-6) << t;
  }
}

TEST(ControlTrack, LimitsHoldAndMissingNamesAreTold) {
  Simulation s = Servo();
  ControlTrack track;
  track.names = {"first", "third"};
  track.times = {0};
  track.rows = {{5, 7}};
  EXPECT_EQ(track.FindMissing(s), std::vector<std::string>{"third"});
  track.Apply(0, s);  // what is not there is passed over
  EXPECT_EQ(s.controls()(0), 1);
  EXPECT_EQ(s.controls()(1), 0);
  ControlTrack empty;
  empty.Apply(0, s);
  EXPECT_EQ(s.controls()(0), 1);
}

TEST(ControlTrack, TwoRowsAtOneTimeAreAJump) {
  Simulation s = Servo();
  ControlTrack track;
  track.names = {"first"};
  track.times = {0, 1, 1, 2};
  track.rows = {{0}, {0}, {0.5}, {0.5}};
  track.Apply(0.999, s);
  EXPECT_EQ(s.controls()(0), 0);
  track.Apply(1, s);
  EXPECT_EQ(s.controls()(0), 0.5);
}

}  // namespace
}  // namespace fork1s
