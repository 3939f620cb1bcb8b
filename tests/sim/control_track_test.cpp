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
                                {-5, 0.1, 0}, {0, 0.1, 0},      {1, 0.1, 0}, {1.5, 0.2, -0.5}, {2, 0.3, -1},
                                {3, 0.1, 0},  {3.5, 0.0, 0.5}, {4, -0.1, 1}, {100, -0.1, 1}};
  for (const auto& row : expected) {
    track.Apply(row[0], s);
    EXPECT_NEAR(s.controls()(s.FindControl("second")), row[1], 1e-15) << row[0];
    EXPECT_NEAR(s.controls()(s.FindControl("first")), row[2], 1e-15) << row[0];
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
