// Controls that jump between steps and are held within them, by two stages.
#include <allocation_counter.hpp>
#include <cmath>
#include <complex>
#include <string>

#include "support.hpp"

namespace fork1s {
namespace {

using testing::HingeSpring;

/// The arm of testing::TwoLinkArm, a servo at each joint, whose spring and damper are those of the servo.
MechanismDef ServoArm(HingeSpring shoulder, HingeSpring elbow, BaseKind base = BaseKind::kFixed) {
  MechanismDef def = testing::TwoLinkArm(base, shoulder, elbow);
  for (int i = 0; i < 2; ++i) {
    ControlDef servo;
    servo.name = "u" + std::to_string(i);
    servo.terms.emplace_back(FreedomRef{JointIndex(i), 0}, 1.0);
    servo.gain = i == 0 ? shoulder.stiffness : elbow.stiffness;
    servo.is_setpoint = true;
    def.controls.push_back(servo);
  }
  return def;
}

/// A rod on one hinge with a servo, about its centre: inertia 1 kg m².
MechanismDef ServoRod(double stiffness, double damping) {
  MechanismBuilder builder("rod");
  BodyDef rod;
  rod.name = "rod";
  rod.parent = builder.base();
  rod.inertia.mass = 1;
  rod.inertia.rotational = Matrix3::Identity();
  const BodyIndex body = builder.AddBody(rod);
  const JointIndex joint =
      builder.AddJoint(JointDef::Hinge("hinge", body, Vector3::UnitZ()).WithSpring(stiffness, damping));
  ControlDef servo;
  servo.name = "u";
  servo.terms.emplace_back(FreedomRef{joint, 0}, 1.0);
  servo.gain = stiffness;
  servo.is_setpoint = true;
  builder.AddControl(servo);
  builder.SetInterfaces({"rod"});
  return builder.definition();
}

/// x(t) of x'' + 2 ζ ω x' + ω² x = ω², x(0) = x'(0) = 0.
double Response(double omega, double zeta, double t) {
  const std::complex<double> root = std::sqrt(std::complex<double>(zeta * zeta - 1)),
                             i1 = omega * (-zeta + root), i2 = omega * (-zeta - root);
  return 1 - std::real((i2 * std::exp(i1 * t) - i1 * std::exp(i2 * t)) / (i2 - i1));
}

double Joint(World& world, int i) { return world.mechanisms()[0].configuration().q(i); }

// What the step can follow, it follows as the closed form does; of what it cannot, it goes to the end.
TEST(ControlJump, OfOneModeEndsWhereTheClosedFormDoes) {
  const double h = 1.0 / 60;
  for (const double zeta : {0.4, 0.7, 1.1, 3.0, 10.0})
    for (const double per_step : {0.3, 1.0, 3.0, 5.0, 10.0, 30.0, 100.0, 1000.0}) {
      const double omega = per_step / h;
      World world = testing::MustCreate(ServoRod(omega * omega, 2 * zeta * omega));
      world.Step(testing::TwoStage(h));
      world.mechanisms()[0].controls()(0) = 0.1;
      double most = 0, most_right = 0, worst = 0;
      for (int k = 1; k <= 10; ++k) {
        EXPECT_EQ(world.Step(testing::TwoStage(h)).parts, 1);
        const double right = Response(omega, zeta, k * h);
        most = std::max(most, Joint(world, 0) / 0.1);
        most_right = std::max(most_right, right);
        worst = std::max(worst, std::abs(Joint(world, 0) / 0.1 - right));
      }
      SCOPED_TRACE("damping ratio " + std::to_string(zeta) + ", ω h = " + std::to_string(per_step));
      // 0.095 at ω h = 3, which the step still follows, and 0.02 beyond; a jump in the first stage had 0.38.
      EXPECT_LT(most, std::max(1.0, most_right) + (per_step < 5 ? 0.1 : 0.02));
      // Where the mode is nearly there after a step, 0.05: the step ends at the static answer.
      if (per_step >= 10) {
        EXPECT_LT(worst, 0.06);
      }
      // Followed as before: second order.
      if (per_step < 0.5) {
        EXPECT_LT(worst, 0.003);
      }
    }
}

TEST(ControlJump, OfCoupledServosDoesNotOvershoot) {
  for (const double scale : {1.0, 10.0, 1e3, 1e5})
    for (const double h : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
      if (scale == 1 && h < 0.01) continue;  // followed, with the overshoot of the servo itself
      const double d = std::sqrt(scale);
      World world = testing::MustCreate(ServoArm({30000 * scale, 32 * d}, {15000 * scale, 16 * d}));
      world.Step(testing::TwoStage(h));
      auto& controls = world.mechanisms()[0].controls();
      controls << 0.8, -0.6;
      for (int k = 0; k < 20; ++k) {
        EXPECT_EQ(world.Step(testing::TwoStage(h)).parts, 1);
        EXPECT_LT(Joint(world, 0) / 0.8, 1.02)
            << "stiffness times " << scale << ", step " << k << " of " << h;
        EXPECT_LT(Joint(world, 1) / -0.6, 1.02)
            << "stiffness times " << scale << ", step " << k << " of " << h;
      }
      EXPECT_NEAR(Joint(world, 0), 0.8, 1e-3);
    }
}

// A step in parts takes the jump in the first of them, and one that is undone keeps it for the next.
TEST(ControlJump, IsStateOfTheStep) {
  World world = testing::MustCreate(ServoArm({3e5, 100}, {1.5e5, 50}));
  world.Step(testing::TwoStage(1.0 / 60));
  world.mechanisms()[0].controls() << 0.8, -0.6;
  WorldState saved;
  world.Save(saved);
  world.Step(testing::TwoStage(1.0 / 60));
  const double q = Joint(world, 0);
  world.Restore(saved);
  world.Step(testing::TwoStage(1.0 / 60));
  EXPECT_EQ(Joint(world, 0), q);
  EXPECT_GT(q, 0.78);
}

TEST(ControlJump, DoesNotAllocate) {
  World world = testing::MustCreate(ServoArm({3e5, 100}, {1.5e5, 50}));
  const auto jump = [&](int i) {
    world.mechanisms()[0].controls() << (i % 2 ? 0.1 : -0.1), 0.05 * i;
    world.Step(testing::TwoStage(1.0 / 60));
  };
  for (int i = 0; i < 4; ++i) jump(i);
  const long before = testing::allocations.load();
  for (int i = 0; i < 8; ++i) jump(i);
  EXPECT_EQ(testing::allocations.load(), before);
}

}  // namespace
}  // namespace fork1s
