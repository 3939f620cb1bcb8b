// Two pegs on a tilted part that is pressed into two slots, off by less than their room: they wedge, held by friction.
#include <gtest/gtest.h>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/queries.hpp>
#include <fork1s/sim/simulation.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace fork1s {
namespace {

// Pegs of 10 mm, 30 mm apart and one 0.05 mm too far, in slots of 10.1 mm; the part is on a spring along x and
// another about y, tilted by 0.3 degrees, and `off` [m] beside the slots.
std::string TwoPegs(double off) {
  std::string slots, pegs;
  for (const auto& [from, to] : {std::pair{-0.06, -0.02005}, {-0.00995, 0.00995}, {0.02005, 0.06}})
    slots += fmt::format("<geom type='box' pos='{} 0 -.015' size='{} .01 .015' friction='.2'/>",
                         (from + to) / 2, (to - from) / 2);
  for (const double x : {-0.015, 0.01505})
    pegs += fmt::format(
        "<geom type='box' pos='{0} 0 -.012' size='.005 .006 .012' mass='.03' friction='.2'/>"
        "<geom type='box' pos='{0} 0 -.0255' size='.0043 .006 .0015' mass='.003' friction='.2'/>",
        x);
  return fmt::format(
      "<mujoco><compiler angle='degree'/><worldbody>{}<body name='tool' pos='{} 0 .03'>"
      "<joint name='z' type='slide' axis='0 0 1'/><inertial pos='0 0 0' mass='1' diaginertia='1e-3 1e-3 1e-3'/>"
      "<body name='part' euler='0 .3 0'><joint type='slide' axis='1 0 0' stiffness='4000' damping='10'/>"
      "<joint axis='0 1 0' stiffness='20' damping='.05'/>{}</body></body></worldbody>"
      "<actuator><position joint='z' kp='2e4' kv='400'/></actuator></mujoco>",
      slots, off, pegs);
}

// Their walls overlap by more than the depth to which contacts are linear, and each step at rest multiplied what they
// bore by the ratio, without a bound.
TEST(Jam, BearsABoundedForceThatStays) {
  for (const double off : {4e-5, 6e-5}) {
    SCOPED_TRACE(off);
    auto imported = LoadMechanismFromString(TwoPegs(off), "pegs", {});
    ASSERT_TRUE(imported) << imported.error().Text();
    auto simulation = Simulation::Create(imported->scene, {});
    ASSERT_TRUE(simulation) << simulation.error().Text();
    double at_rest = 0;
    for (int i = 0; i < 240; ++i) {
      simulation->SetControl(0, -0.024 * std::min(1.0, (i + 1) / 60.0));
      ASSERT_TRUE(simulation->Step(true).IsSolved()) << i;
      double largest = 0;
      for (const BodyContact& c : Contacts(*simulation)) largest = std::max(largest, c.force_W.norm());
      EXPECT_LT(largest, 1000) << i;
      if (i == 120) at_rest = largest;
      if (i > 120) {
        EXPECT_NEAR(largest, at_rest, 1e-3 * at_rest) << i;
      }
    }
    EXPECT_GT(at_rest, 100);  // 400 N press down; a peg that enters bears a few
  }
}

// Three fingers of three boxes about a palm, drawn at random, that overlap by up to half of their size where they start.
std::string OverlappingFingers() {
  constexpr double kTurnsAndAxes[9][5] = {
      {-11.919, -10.075, 15.711, -0.816, 0.200}, {11.428, -15.605, -22.243, -0.450, 0.315},
      {3.113, -17.497, -3.368, 0.339, -0.154},   {6.659, 23.372, 9.153, -0.217, -0.625},
      {-7.702, 0.553, 19.560, 0.551, -0.364},    {21.211, -1.455, 9.688, -0.786, -0.791},
      {-14.905, 19.222, 8.991, 0.698, 0.289},    {-4.673, 0.829, 4.672, 0.724, -0.124},
      {19.612, 5.686, 16.468, -0.004, 0.385}};
  constexpr double kRoots[3][2] = {{0.05, 0}, {-0.025, 0.0433}, {-0.025, -0.0433}};
  std::string fingers;
  for (int i = 0; i < 9; ++i) {
    const auto& [a, b, c, x, y] = kTurnsAndAxes[i];
    const bool is_root = i % 3 == 0;
    const double px = is_root ? kRoots[i / 3][0] : 0, py = is_root ? kRoots[i / 3][1] : 0;
    fingers += fmt::format(
        "<body pos='{} {} {}' euler='{} {} {}'><joint axis='{} {} .2' range='-60 60' stiffness='1' damping='.05'/>"
        "<geom type='box' size='.03 .025 .025' pos='{:.4f} {:.4f} .02' mass='.05'/>",
        px, py, is_root ? 0 : 0.04, a, b, c, x, y, -0.5 * px, -0.5 * py);
    if (i % 3 == 2) fingers += "</body></body></body>";
  }
  return "<mujoco><worldbody><body name='palm'><geom type='box' size='.01 .01 .005' contype='0' conaffinity='0'/>" +
         fingers + "</body></worldbody></mujoco>";
}

// Contacts on nine joints that press from all sides with thousands of times what is left of them. The first step took
// millions of iterations, and parts of it whose contacts were not solved were taken all the same.
TEST(Jam, OverlappingFingers_AreSolvedOrHalved) {
  auto imported = LoadMechanismFromString(OverlappingFingers(), "fingers", {});
  ASSERT_TRUE(imported) << imported.error().Text();
  auto simulation = Simulation::Create(imported->scene, {});
  ASSERT_TRUE(simulation) << simulation.error().Text();
  for (int i = 0; i < 20; ++i) {
    const StepReport report = simulation->Step();
    EXPECT_TRUE(report.finite && report.IsSolved()) << i;
    EXPECT_LT(report.solver.newton_iterations, 12000) << i;
  }
}

}  // namespace
}  // namespace fork1s
