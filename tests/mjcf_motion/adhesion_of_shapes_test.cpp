// Sticky shapes, whose contacts pull without an actuator, in closed form.
#include "support.hpp"

namespace fork1s::adhesion_test {
namespace {

// A box of 0.5 kg under a ceiling, four points of contact.
std::string Ceiling(double of_ceiling, double of_block, const std::string& more = "") {
  return fmt::format(
      "<mujoco><worldbody><geom name='ceiling' type='box' size='.3 .3 .05' pos='0 0 .25' adhesion='{}' {}/>"
      "<body name='block' pos='0 0 .1'><freejoint/><geom name='block' type='box' size='.1 .1 .1' mass='.5' "
      "adhesion='{}'/></body></worldbody></mujoco>",
      of_ceiling, more, of_block);
}

// Both add up, at each point.
TEST(AdhesionOfShapes, BlockUnderACeiling_HangsByTheSumOfItsPoints) {
  const double weight = 0.5 * kGravity;
  for (const auto& [ceiling, block] :
       {std::pair{0.3 * weight, 0.0}, {0.2 * weight, 0.1 * weight}, {0.0, 0.26 * weight}}) {
    Simulation s = MustStart(Ceiling(ceiling, block), 1. / 60);
    RunUntil(s, 1);
    EXPECT_NEAR(Place(s, "block").z(), 0.1, 2e-5);
    const Normal force = NormalForces(s);
    EXPECT_EQ(force.count, 4);
    EXPECT_NEAR(force.pull, 4 * (ceiling + block), 1e-9 * weight);
    EXPECT_NEAR(force.contact, 4 * (ceiling + block) - weight, 1e-3 * weight);
  }
}

TEST(AdhesionOfShapes, TooWeak_LetsGo) {
  const double weight = 0.5 * kGravity;
  Simulation s = MustStart(Ceiling(0.12 * weight, 0.12 * weight), 1. / 60);
  RunUntil(s, 1);
  EXPECT_LT(Place(s, "block").z(), -4);
}

TEST(AdhesionOfShapes, HigherPriority_DecidesAlone) {
  const double weight = 0.5 * kGravity;
  Simulation holds = MustStart(Ceiling(0.3 * weight, 0, "priority='1'"), 1. / 60);
  RunUntil(holds, 1);
  EXPECT_NEAR(Place(holds, "block").z(), 0.1, 2e-5);
  Simulation drops = MustStart(Ceiling(0, weight, "priority='1'"), 1. / 60);
  RunUntil(drops, 1);
  EXPECT_LT(Place(drops, "block").z(), -4);
}

// On a wall friction has µ times the pull.
TEST(AdhesionOfShapes, BlockOnAWall_IsHeldByFrictionOfThePull) {
  const double weight = 0.5 * kGravity, mu = 0.5;
  for (const double share : {1.02, 0.9}) {
    Simulation s = MustStart(
        fmt::format(
            "<mujoco><worldbody><geom name='wall' type='box' size='.05 2 5' friction='{}'/>"
            "<body name='block' pos='.07 0 0'><freejoint/><geom name='block' type='box' size='.02 .1 .1' "
            "mass='.5' friction='{}'/></body></worldbody><contact><pair geom1='wall' geom2='block' "
            "adhesion='{:.17g}' friction='{} {} 0 0 0'/></contact></mujoco>",
            mu, mu, share * weight / (4 * mu), mu, mu),
        1. / 60);
    RunUntil(s, 1);
    const double fallen = -Place(s, "block").z();
    if (share > 1)
      EXPECT_LT(fallen, 2e-5);
    else
      EXPECT_NEAR(fallen, (1 - share) * kGravity / 2, 1e-2 * kGravity / 2);
  }
}

// A magnet: what is within the gap is drawn up.
TEST(AdhesionOfShapes, GapIsTheReach) {
  const double weight = 0.5 * kGravity;
  for (const double gap : {0.001, 0.003}) {
    Simulation s = MustStart(
        fmt::format("<mujoco><worldbody><geom name='ceiling' type='box' size='.3 .3 .05' pos='0 0 .252' "
                    "adhesion='{}' gap='{}'/><body name='block' pos='0 0 .1'><freejoint/><geom "
                    "name='block' type='box' size='.1 .1 .1' mass='.5'/></body></worldbody></mujoco>",
                    0.5 * weight, gap),
        1. / 240);
    RunUntil(s, 0.5);
    if (gap > 0.002)
      EXPECT_NEAR(Place(s, "block").z(), 0.102, 2e-5);
    else
      EXPECT_LT(Place(s, "block").z(), -1);
  }
}

}  // namespace
}  // namespace fork1s::adhesion_test
