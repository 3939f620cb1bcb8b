// Belts and turntables: surfaces that move within themselves, in closed form and beside the full model.
#include <algorithm>
#include <cmath>
#include <fork1s/reference/full_simulation.hpp>
#include <fork1s/sim/run_statistics.hpp>
#include <mjcf_text.hpp>

namespace fork1s {
namespace {

using testing::MustLoad;
using testing::MustStart;

// The belt is a box turned by `angle` about the vertical that runs along its own x at 1 m/s.
std::string Belt(double angle, const std::string& parcel) {
  return fmt::format(
      "<mujoco><compiler angle='radian'/><worldbody><geom type='box' size='4 .6 .05' pos='0 0 -.05' euler='0 0 {}' "
      "surfacevel='1 0 0 0 0 0' friction='.3'/><body name='parcel' pos='0 0 {}'><freejoint/>{}</body></worldbody></mujoco>",
      angle, 0.1, parcel);
}

// µ g until it has the speed of the belt, then with it; friction takes ½ m v² meanwhile, as much as the parcel gains.
TEST(MovingSurface, ParcelOnBelt_IsTakenAlongByFriction) {
  for (const double dt : {1. / 60, 1. / 240})
    for (const double angle : {0.0, 0.7, -2.0}) {
      SCOPED_TRACE(fmt::format("{} {}", dt, angle));
      Simulation s =
          MustStart((Belt(angle, "<geom type='box' size='.1 .1 .1' mass='2' friction='.3'/>")), dt);
      RunStatistics statistics;
      statistics.Begin(s);
      const double mu = 0.3, t = 2, slides = 1 / (mu * testing::kGravity);
      while (s.time() < t - 1e-9) {
        ASSERT_TRUE(s.Step(true).IsSolved());
        statistics.Update(s);
      }
      const Vector3 along(std::cos(angle), std::sin(angle), 0), p = s.Pose("parcel").translation();
      // The step in which it comes to the speed of the belt is taken whole: within µ g dt²/2, twice.
      EXPECT_NEAR(along.dot(p), t - slides / 2, mu * testing::kGravity * dt * dt);
      EXPECT_NEAR(along.cross(p).z(), 0, 1e-6);
      EXPECT_NEAR(statistics.FrictionLoss(), 0.5 * 2 * 1, 2 * 2 * mu * testing::kGravity * dt);
    }
}

// Both are stages of the same equation, by code of their own.
TEST(MovingSurface, ParcelOnBelt_MovesAsInTheFullModel) {
  const std::string text =
      Belt(0.4,
           "<geom type='box' size='.1 .05 .1' mass='2' friction='.3'/><geom type='sphere' "
           "size='.03' pos='.05 .02 .12' mass='1'/>");
  Simulation s = MustStart(text, 1. / 60);
  FullSimulationOptions options;
  options.dt = 1. / 60;
  options.integrator = FullIntegrator::kTwoStages;
  auto full = FullSimulation::Create(MustLoad(text).scene, options);
  ASSERT_TRUE(full) << full.error().Text();
  for (int i = 0; i < 60; ++i) {
    s.Step(true);
    full->Step();
    // Both solve to 1e-6 of the motion of a step; the step that stops sliding passes it on.
    ASSERT_LT((s.Pose("parcel").translation() - full->Pose(0).translation()).norm(), 1e-5) << i;
  }
  EXPECT_GT(s.Pose("parcel").translation().norm(), 0.5);
}

std::string Turntable(double omega, double radius, const std::string& shape) {
  return fmt::format(
      "<mujoco><worldbody><geom type='cylinder' size='1 .05' pos='.2 -.1 -.05' surfacevel='0 0 0 0 0 {}'/>"
      "<body name='load' pos='{} -.1 .05'><freejoint/>{}</body></worldbody></mujoco>",
      omega, 0.2 + radius, shape);
}

// ω r across the radius, held on its circle by friction of ω² r.
TEST(MovingSurface, BoxOnTurntable_CirclesWithIt) {
  const double omega = 2, r = 0.5, t = 3;
  Simulation s = MustStart(Turntable(omega, r, "<geom type='box' size='.05 .05 .05' mass='1'/>"), 1. / 60);
  while (s.time() < t - 1e-9) ASSERT_TRUE(s.Step(true).IsSolved());
  const Vector3 at = s.Pose("load").translation() - Vector3(0.2, -0.1, 0);
  // It slides at first, up to ω r at µ g = 9.81 m/s², which takes 0.1 s and leads it outwards and behind by less than
  // ω r/2 times that.
  EXPECT_NEAR(at.head<2>().norm(), r, 0.05);
  const Vector6 V = s.Velocity(0);
  EXPECT_NEAR(V.tail<3>().head<2>().norm(), omega * at.head<2>().norm(), 2e-3 * omega * r);
  EXPECT_NEAR(V(2), omega, 2e-3 * omega);
}

// A ball in the middle is turned by torsional friction alone: α = torsion m g/I.
TEST(MovingSurface, BallInTheMiddle_IsSpunByTorsion) {
  const double omega = 30, torsion = 0.01, radius = 0.05, inertia = 0.4 * radius * radius;
  Simulation s = MustStart(
      (Turntable(omega, 0,
                 fmt::format("<geom type='sphere' size='{}' mass='1' condim='4' friction='1 {} 0'/>", radius,
                             torsion))),
      1. / 60);
  const double alpha = torsion * testing::kGravity / inertia;
  for (int i = 1; i <= 60; ++i) {
    ASSERT_TRUE(s.Step(true).IsSolved());
    EXPECT_NEAR(s.Velocity(0)(2), std::min(omega, alpha * s.time()), 1e-2 * omega) << i;
  }
}

// A blade on ice that does not roll: 0.05 along it, 1 across.
TEST(AnisotropicFriction, Skate_SlidesAlongItsBladeAndHoldsAcross) {
  const char* skate =
      R"(<mujoco><option gravity="{} {} -9.81"/><worldbody><geom name="floor" type="plane" size="0 0 1"/>
    <body name="skate" pos="0 0 .02" euler="0 0 {}">
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
      <geom name="blade" type="capsule" fromto="-.1 0 0 .1 0 0" size=".02" mass="1"/></body></worldbody>
    <contact><pair geom1="floor" geom2="blade" friction=".05 1 .005 .0001 .0001"/></contact></mujoco>)";
  for (const double degrees : {0.0, 35.0, 110.0}) {
    SCOPED_TRACE(degrees);
    const double angle = degrees * M_PI / 180, push = 2, t = 1;
    const Vector3 along(std::cos(angle), std::sin(angle), 0), across(-along.y(), along.x(), 0);
    const auto slid = [&](const Vector3& a) {
      Simulation s =
          MustStart((fmt::format(fmt::runtime(skate), push * a.x(), push * a.y(), degrees)), 1. / 60);
      while (s.time() < t - 1e-9) EXPECT_TRUE(s.Step(true).IsSolved());
      for (const ContactRecord& c : s.world().contacts()) {
        // Within the ellipse of its shares along the tangents.
        const double use = c.impulse.tail<2>().norm() / (c.friction * c.impulse(0));
        EXPECT_NEAR(use, std::abs(a.dot(along)) > 0.5 ? 1 : push / testing::kGravity, 1e-2);
      }
      return Vector3(s.Pose("skate").translation() - Vector3(0, 0, 0.02));
    };
    const double way = (push - 0.05 * testing::kGravity) * t * t / 2;
    EXPECT_NEAR(slid(along).dot(along), way, 1e-2 * way);
    EXPECT_LT(slid(across).norm(), 1e-4);
  }
}

}  // namespace
}  // namespace fork1s
