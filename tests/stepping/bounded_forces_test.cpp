// Servos that can give no more, and dry friction, against closed forms.
#include <cmath>

#include "support.hpp"

namespace fork1s {
namespace {

constexpr double kGravity = 9.81, kArm = 0.5, kTip = 0.02;

/// An arm of length kArm about y that a servo swings; with a ball at its tip.
MechanismDef Arm(double stiffness, double damping, double limit) {
  MechanismBuilder builder("arm");
  BodyDef rod;
  rod.name = "rod";
  rod.parent = builder.base();
  rod.inertia = testing::Rod(1, kArm);
  rod.geometries.push_back(testing::Geometry("tip", Sphere{kTip}, 0, RigidTransform(Vector3(kArm, 0, 0))));
  const BodyIndex b = builder.AddBody(rod);
  const JointIndex joint =
      builder.AddJoint(JointDef::Hinge("elbow", b, Vector3::UnitY()).WithSpring(stiffness, damping));
  ControlDef servo;
  servo.name = "servo";
  servo.terms.emplace_back(FreedomRef{joint, 0}, 1.0);
  servo.gain = stiffness;
  servo.is_setpoint = true;
  builder.AddControl(servo);
  builder.SetInterfaces({"rod"});
  MechanismDef def = builder.definition();
  ForceLimitDef bound;
  bound.name = "servo";
  bound.terms = {{FreedomRef{joint, 0}, 1.0}};
  bound.inputs = {{"servo", 1.0}};
  bound.stiffness = stiffness;
  bound.damping = damping;
  bound.lower = -limit;
  bound.upper = limit;
  def.force_limits.push_back(bound);
  return def;
}

/// A slide along x of the given mass with dry friction, and a spring if asked.
MechanismDef Slide(double mass, double friction, double stiffness = 0) {
  MechanismBuilder builder("slide");
  BodyDef block;
  block.name = "block";
  block.parent = builder.base();
  block.inertia = testing::Ball(mass, 0.1);
  const BodyIndex b = builder.AddBody(block);
  const JointIndex joint =
      builder.AddJoint(JointDef::Slide("rail", b, Vector3::UnitX()).WithSpring(stiffness));
  builder.SetInterfaces({"block"});
  MechanismDef def = builder.definition();
  def.frictions.push_back({"rail", {{FreedomRef{joint, 0}, 1.0}}, friction});
  return def;
}

StepOptions Falling(const Vector3& gravity, double h = 1.0 / 60) {
  StepOptions options;
  options.h = h;
  options.gravity = gravity;
  return options;
}

// Pressed against a floor by a set-point far below it, the servo gives its bound and no more: force times
// arm.
TEST(ForceLimit, AServoAgainstAWallBearsItsLimit) {
  for (const double stiffness : {10.0, 1e3, 1e6}) {
    Scene scene;
    scene.mechanisms.push_back(Arm(stiffness, 0.01 * stiffness, 3));
    scene.world.push_back(testing::Geometry("floor", Plane{}, 0, RigidTransform(Vector3(0, 0, -0.1))));
    World world = testing::MustCreate(scene);
    world.mechanisms()[0].controls()(0) = 1.2;
    StepReport report;
    StepOptions step = testing::Still();
    for (int i = 0; i < 600; ++i) report = world.Step(step);
    ASSERT_EQ(world.contacts().size(), 1u) << stiffness;
    const ContactRecord& c = world.contacts()[0];
    const double arm = c.point.point.x();
    EXPECT_NEAR(c.impulse(0) * 60 * arm, 3, 3e-6) << stiffness;
    EXPECT_EQ(report.forces_at_bound, 1);
  }
}

// Free under gravity: the bound less than the weight lets it sink, a larger one holds it as the spring would.
TEST(ForceLimit, HoldsWhatItCanAndNoMore) {
  const double weight = kGravity * kArm / 2;  // moment of the rod about its pivot
  for (const double share : {1.01, 0.5}) {
    World world = testing::MustCreate(Arm(1e4, 100, share * weight));
    const StepOptions step = Falling(Vector3(0, 0, -kGravity), 1e-3);
    for (int i = 0; i < (share > 1 ? 3000 : 100); ++i) world.Step(step);
    const double q = world.mechanisms()[0].configuration().q(0);
    if (share > 1) {
      EXPECT_NEAR(q, weight / 1e4, 1e-5);  // the spring's own sag; 1 - cos of it is 1e-7
      continue;
    }
    // q̈ = (weight cos q - bound)/I, I = m l²/3: by fourth-order Runge and Kutta in long steps of its own.
    const double inertia = kArm * kArm / 3;
    double x = 0, v = 0;
    const double h = 1e-4;
    const auto a = [&](double at) { return (weight * std::cos(at) - share * weight) / inertia; };
    for (int i = 0; i < 1000; ++i) {
      const double k1 = a(x), k2 = a(x + h / 2 * v), k3 = a(x + h / 2 * v + h * h / 4 * k1),
                   k4 = a(x + h * v + h * h / 2 * k2);
      x += h * v + h * h / 6 * (k1 + k2 + k3);
      v += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    }
    // Implicit Euler at 1 ms is off by h/t = 1 %; the servo's first millisecond, before it gives way, by
    // less.
    EXPECT_NEAR(q, x, 0.015 * x);
    EXPECT_GT(q, 0.05);
  }
}

// Where the bound is not reached nothing changes, to the last digit.
TEST(ForceLimit, BoundsThatAreNotReachedChangeNothing) {
  MechanismDef with = Arm(50, 1, 1e3), without = with;
  without.force_limits.clear();
  World a = testing::MustCreate(with), b = testing::MustCreate(without);
  for (World* world : {&a, &b}) {
    world->mechanisms()[0].controls()(0) = 0.3;
    for (int i = 0; i < 60; ++i) world->Step(Falling(Vector3(0, 0, -kGravity)));
  }
  EXPECT_EQ(a.mechanisms()[0].configuration().q(0), b.mechanisms()[0].configuration().q(0));
}

// A servo swung past its bound by its own motion: what it stores is F per radian, so energy does not grow.
class ForceLimitEnergy : public ::testing::TestWithParam<Integrator> {};

TEST_P(ForceLimitEnergy, NeverGrows) {
  World world = testing::MustStart(Arm(1e3, 0, 1), VectorX::Zero(1), VectorX::Constant(1, 8));
  StepOptions step = testing::Still(1e-3);
  step.integrator = GetParam();
  double before = world.KineticEnergy() + world.PotentialEnergy(Vector3::Zero()), first = before;
  double least = before;
  for (int i = 0; i < 600; ++i) {
    world.Step(step);
    const double energy = world.KineticEnergy() + world.PotentialEnergy(Vector3::Zero());
    EXPECT_LE(energy, before + 1e-9 * first);
    before = energy;
    least = std::min(least, energy);
  }
  EXPECT_GT(least, 0.5 * first);  // implicit Euler at 1 ms takes a tenth of it or so, not the half
}

INSTANTIATE_TEST_SUITE_P(Integrators, ForceLimitEnergy,
                         ::testing::Values(Integrator::kEuler, Integrator::kTwoStage));

TEST(DryFriction, KeepsAPoseUnderAnyLoadBelowIt) {
  for (const double share : {0.1, 0.9, 0.999}) {
    World world = testing::MustCreate(Slide(2, 5));
    for (int i = 0; i < 300; ++i) world.Step(Falling(Vector3(share * 5 / 2, 0, 0)));
    // The solver's tolerance of 1e-5 of the speed at hand, 0.04 m/s, is not used: one row is solved exactly.
    EXPECT_NEAR(world.mechanisms()[0].configuration().q(0), 0, 1e-12) << share;
  }
}

TEST(DryFriction, SlipsAboveIt) {
  World world = testing::MustCreate(Slide(2, 5));
  for (int i = 0; i < 60; ++i) world.Step(testing::BackwardEuler(1.0 / 60, Vector3(4, 0, 0)));
  const double a = (2 * 4 - 5) / 2.0, h = 1.0 / 60;
  // Implicit Euler from rest: x = a h² n (n + 1)/2.
  EXPECT_NEAR(world.mechanisms()[0].configuration().q(0), a * h * h * 60 * 61 / 2, 1e-9);
}

// A block let go on a spring with friction stops within F/k of the middle, after halves of a swing that each
// lose 2F/k of their reach.
TEST(DryFriction, ASwingLosesTwoForcesOverStiffnessEachHalf) {
  const double k = 100, F = 5, start = 0.52;
  World world = testing::MustStart(Slide(1, F, k), VectorX::Constant(1, start), VectorX::Zero(1));
  double lowest = 0;
  for (int i = 0; i < 40000; ++i) {
    world.Step(testing::Still(1e-4));
    lowest = std::min(lowest, world.mechanisms()[0].configuration().q(0));
  }
  // First turn at -(start - 2F/k); implicit Euler at 1e-4 s loses ω h π/4 = 8e-4 of the reach by itself.
  EXPECT_NEAR(lowest, -(start - 2 * F / k), 1e-3);
  const double q = world.mechanisms()[0].configuration().q(0);
  EXPECT_LE(std::abs(q), F / k + 1e-9);
  EXPECT_LT(std::abs(world.mechanisms()[0].state().w(0)), 1e-9);
  EXPECT_GT(std::abs(q), 1e-3);  // it does not creep to the middle
}

}  // namespace
}  // namespace fork1s
