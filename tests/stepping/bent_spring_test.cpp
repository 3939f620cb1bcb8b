// Springs and dampers that are not linear.
#include <gtest/gtest.h>

#include <cmath>
#include <fork1s/mechanism/builder.hpp>

#include "support.hpp"

namespace fork1s {
namespace {

constexpr double kSledMass = 2, kSledStiffness = 30;

// A sled on rails along x, held by one spring.
MechanismDef Sled(const SpringDef& held) {
  MechanismBuilder builder("sled");
  BodyDef body;
  body.name = "sled";
  body.parent = builder.base();
  body.inertia = testing::Ball(kSledMass, 0.1);
  const BodyIndex b = builder.AddBody(body);
  const JointIndex slide = builder.AddJoint(JointDef::Slide("rail", b, Vector3::UnitX()));
  SpringDef spring = held;
  spring.name = "spring";
  spring.terms = {{{slide, 0}, 1.0}};
  builder.AddSpring(spring);
  builder.SetInterfaces({"sled"});
  return builder.definition();
}

SpringDef Hardening() {
  SpringDef s;
  s.stiffness = kSledStiffness;
  s.higher_stiffness = {40, 5000};
  return s;
}

double SledAt(const World& world) { return world.mechanisms()[0].configuration().q(0); }

TEST(BentSpring, RestsWhereItBearsTheLoad) {
  SpringDef s = Hardening();
  s.damping = 20;
  for (const Integrator by : {Integrator::kEuler, Integrator::kTwoStage}) {
    SCOPED_TRACE(by == Integrator::kTwoStage);
    World world = testing::MustCreate(Sled(s));
    StepOptions step;
    step.integrator = by;
    const double load = 9.81 * kSledMass;
    step.gravity = Vector3(9.81, 0, 0);
    for (int i = 0; i < 600; ++i) ASSERT_TRUE(world.Step(step).finite);
    const double x = SledAt(world);
    // 19.62 N stretches it to 0.13 m: 30 x + 40 x² + 5000 x³.
    EXPECT_NEAR(kSledStiffness * x + 40 * x * x + 5000 * x * x * x, load, 1e-9 * load);
  }
}

// What a refresh sees: the stiffness of the pose.
TEST(BentSpring, CompliesAsStiffAsItIsThere) {
  const auto m = testing::Share(Sled(Hardening()));
  for (const double q : {0.0, 0.2, -0.1}) {
    Kinematics k(*m);
    const VectorX at = VectorX::Constant(1, q);
    ComputeKinematics(*m, at, k);
    EXPECT_NEAR(StiffnessMatrix(*m, k, at)(0, 0), kSledStiffness + 80 * q + 15000 * q * q, 1e-10);
    const auto model = Reduce(m, at);
    ASSERT_TRUE(model);
    // K_r is 1 in coordinates that are scaled to it: Q Qᵀ is the compliance.
    EXPECT_NEAR((model->Q * model->Q.transpose())(0, 0) * (kSledStiffness + 80 * q + 15000 * q * q), 1,
                1e-12);
  }
}

// Quarter of a swing from rest at x₀: ∫ dx / √(2 (U(x₀) - U(x))/m), with x = x₀ sin φ so that nothing is
// singular.
double QuarterSwing(double x0) {
  const auto U = [](double x) { return x * x * (15 + x * (40.0 / 3 + x * 1250)); };
  const int n = 20000;
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    const double phi = (i + 0.5) * std::acos(0.0) / n, x = x0 * std::sin(phi);
    sum += x0 * std::cos(phi) / std::sqrt(2 * (U(x0) - U(x)) / kSledMass);
  }
  return sum * std::acos(0.0) / n;
}

TEST(BentSpring, SwingsAsLongAsItsPotentialSays) {
  constexpr double kStart = 0.3;
  double error[2];
  for (int halved = 0; halved < 2; ++halved) {
    World world = testing::MustStart(Sled(Hardening()), VectorX::Constant(1, kStart), VectorX::Zero(1));
    StepOptions step = testing::Still(0.004 / (1 << halved));
    step.integrator = Integrator::kTwoStage;
    double before = kStart, t = 0;
    const double energy = world.PotentialEnergy(step.gravity);
    while (SledAt(world) > 0) {
      before = SledAt(world);
      ASSERT_TRUE(world.Step(step).finite);
      t += step.h;
    }
    const double now = SledAt(world), crossed = t + step.h * now / (before - now);
    error[halved] = std::abs(crossed / QuarterSwing(kStart) - 1);
    EXPECT_NEAR(world.KineticEnergy() + world.PotentialEnergy(step.gravity), energy, 0.01 * energy);
  }
  EXPECT_LT(error[0], 0.01);  // 16 steps to a quarter of a swing
  EXPECT_LT(error[1], 0.35 * error[0]);
}

// Implicit Euler holds at any step, however hard it gets, and never gains.
TEST(BentSpring, NeverGainsAtLargeSteps) {
  for (const double scale : {1.0, 1e4}) {
    SpringDef s = Hardening();
    s.stiffness *= scale;
    for (double& higher : s.higher_stiffness) higher *= scale;
    World world = testing::MustStart(Sled(s), VectorX::Constant(1, 0.3), VectorX::Zero(1));
    const StepOptions step = testing::BackwardEuler();
    double energy = world.KineticEnergy() + world.PotentialEnergy(step.gravity);
    for (int i = 0; i < 600; ++i) {
      ASSERT_TRUE(world.Step(step).finite);
      const double now = world.KineticEnergy() + world.PotentialEnergy(step.gravity);
      EXPECT_LE(now, energy * (1 + 1e-9)) << i;
      energy = now;
    }
  }
}

// Speed after a second of a sled of 2 m/s that only the damper slows.
double SlowedBy(const SpringDef& s, double h) {
  World world = testing::MustStart(Sled(s), VectorX::Zero(1), VectorX::Constant(1, 2));
  for (int i = 0; i < std::lround(1 / h); ++i) world.Step(testing::BackwardEuler(h));
  return std::sqrt(2 * world.KineticEnergy() / kSledMass);
}

// m v' = -d₂ v² by backward Euler: m (v⁺ - v) = -h d₂ v⁺².
TEST(BentSpring, DragOfTheSquareOfSpeed) {
  SpringDef s;
  s.higher_damping = {3, 0};
  for (const double h : {0.1, 0.01}) {
    const double a = h * 3 / kSledMass;
    double v = 2;
    for (int i = 0; i < std::lround(1 / h); ++i) v = (std::sqrt(1 + 4 * a * v) - 1) / (2 * a);
    EXPECT_NEAR(SlowedBy(s, h), v, 2e-5);  // 1e-6 of the motion in each of a hundred stages
  }
}

// m v' = -d₃ v³: v = v₀/√(1 + 2 d₃ v₀² t/m).
TEST(BentSpring, DragOfTheCubeOfSpeed) {
  SpringDef s;
  s.higher_damping = {0, 3};
  const double truth = 2 / std::sqrt(1 + 2 * 3 * 4 / kSledMass), coarse = SlowedBy(s, 0.01) - truth,
               fine = SlowedBy(s, 0.005) - truth;
  EXPECT_LT(std::abs(coarse), 0.05 * truth);  // of first order
  EXPECT_NEAR(fine / coarse, 0.5, 0.05);
}

}  // namespace
}  // namespace fork1s
