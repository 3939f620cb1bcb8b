// Lengths that start outside their limits are brought inside at a bounded speed, in both simulators.
#include <fmt/format.h>

#include <cmath>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>
#include <functional>

#include "mechanism/limits_at_start.hpp"
#include "support.hpp"

namespace fork1s::reference_test {
namespace {

constexpr double kRopeLimit = 0.3, kRopeBeyond = 0.02, kBallMass = 0.5;  // m, m, kg

Scene Import(const std::string& text, bool keep_start = false) {
  ImportOptions options;
  options.keep_start = keep_start;
  auto imported = LoadMechanismFromString(text, "limits.xml", options);
  if (!imported) throw std::runtime_error(imported.error().Text());
  return std::move(imported->scene);
}

// A ball on a rope from (0, 0, 1) that starts below the end of the rope's limit: on a slide or free.
Scene BallOnRope(const std::string& joint) {
  return Import(fmt::format(R"(<mujoco><compiler angle="radian"/><worldbody><site name="top" pos="0 0 1"/>
    <body name="ball" pos="0 0 {}">{}<geom size=".02" mass="{}"/><site name="eye"/></body></worldbody>
    <tendon><spatial name="rope" limited="true" range="0 {}"><site site="top"/><site site="eye"/></spatial></tendon>
    </mujoco>)",
                            1 - kRopeLimit - kRopeBeyond, joint, kBallMass, kRopeLimit));
}

// Calls `look` with the height of `body` after each step.
void RunFull(const Scene& scene, double h, FullIntegrator integrator, double seconds,
             const std::function<void(double)>& look) {
  FullSimulation full = Start(scene, h, integrator);
  const int body = full.FindBody("ball");
  for (int i = 0; i < static_cast<int>(std::lround(seconds / h)); ++i) {
    ASSERT_TRUE(full.Step().converged) << i;
    look(full.Pose(body).translation().z());
  }
}

void RunReduced(const Scene& scene, double h, Integrator integrator, double seconds,
                const std::function<void(double)>& look) {
  SimulationOptions options;
  options.dt = h;
  options.step.integrator = integrator;
  auto reduced = Simulation::Create(scene, options);
  ASSERT_TRUE(reduced) << reduced.error().Text();
  for (int i = 0; i < static_cast<int>(std::lround(seconds / h)); ++i) {
    ASSERT_TRUE(reduced->Step().IsSolved()) << i;
    look(reduced->Pose("ball").translation().z());
  }
}

// What is told is passed by more than a thousandth of the length scale, or of a radian.
TEST(StopsPassedAtStart, AreToldFromAShareOfTheLengthOn) {
  auto rope =
      BuildMechanism(BallOnRope(R"(<joint name="slide" type="slide" axis="0 0 1"/>)").mechanisms.at(0));
  auto hinge = BuildMechanism(Import(R"(<mujoco><compiler angle="radian"/><worldbody><body>
    <joint name="j" axis="0 1 0" range="-1 1"/><geom size=".1"/></body></worldbody></mujoco>)")
                                  .mechanisms.at(0));
  ASSERT_TRUE(rope && hinge);
  for (const double share : {0.9e-3, 1.1e-3}) {
    // Upwards the rope is shorter.
    const VectorX z = VectorX::Constant(1, kRopeBeyond - share * rope->length_scale());
    EXPECT_EQ(internal::DescribeStopsPassedAtStart(*rope, z).size(), share > 1e-3 ? 1u : 0u) << share;
    const VectorX q = VectorX::Constant(1, 1 + share);
    EXPECT_EQ(internal::DescribeStopsPassedAtStart(*hinge, q).size(), share > 1e-3 ? 1u : 0u) << share;
  }
}

class StartOutsideLimits : public ::testing::TestWithParam<double> {};

TEST_P(StartOutsideLimits, BallOnRope_IsLiftedToTheLimitAndRests) {
  const double h = GetParam(), goal = 1 - kRopeLimit;
  for (const std::string joint : {"<joint type='slide' axis='0 0 1'/>", "<freejoint/>"}) {
    const Scene scene = BallOnRope(joint);
    for (int run = 0; run < 4; ++run) {
      SCOPED_TRACE(fmt::format("{} run {}", joint, run));
      double highest = 0, fastest = 0, last = goal - kRopeBeyond;
      const auto look = [&](double z) {
        fastest = std::max(fastest, std::abs(z - last) / h);
        highest = std::max(highest, z);
        last = z;
      };
      if (run < 2)
        RunFull(scene, h, run == 0 ? FullIntegrator::kEuler : FullIntegrator::kTwoStages, 0.5, look);
      else
        RunReduced(scene, h, run == 2 ? Integrator::kEuler : Integrator::kTwoStage, 0.5, look);
      // At 0.1 m/s it hops by 0.1²/(2 g) = 0.5 mm at most.
      EXPECT_LT(fastest, 0.1 + 1e-3);
      EXPECT_LT(highest, goal + 0.1 * 0.1 / (2 * kGravity) + 1e-5);
      EXPECT_NEAR(last, goal, 5e-5);
    }
  }
}

// Without gravity, against dampers: a fixed tendon a + 2 b and a joint that the file starts outside their limits.
TEST_P(StartOutsideLimits, SumOfJointsAndJoint_EndInside) {
  const std::string body =
      "<body name='{0}' pos='0 {1} 0'><joint name='{0}' axis='0 1 0' damping='.5' {2}/>"
      "<geom size='.05' pos='.2 0 0' mass='1' contype='0'/>";
  const auto hinge = [&](const char* name, double y, const char* range) {
    return fmt::format(fmt::runtime(body), name, y, range);
  };
  const Scene scene = Import(
      "<mujoco><compiler angle='radian'/><option gravity='0 0 0'/><worldbody>" + hinge("a", 0, "") +
          hinge("b", 0.3, "") + "</body></body>" + hinge("c", 2, "range='.02 1'") +
          "</body></worldbody><tendon><fixed name='sum' limited='true' range='.03 1'><joint joint='a' coef='1'/>"
          "<joint joint='b' coef='2'/></fixed></tendon></mujoco>",
      true);
  const double h = GetParam();
  const auto check = [](const VectorX& of_sum, const VectorX& of_joint) {
    ASSERT_EQ(of_sum.size(), 2);
    ASSERT_EQ(of_joint.size(), 1);
    const double sum = of_sum[0] + 2 * of_sum[1];
    // Dampers d stop what the limit moved at 0.1 rad/s within 0.1 s λ/d, λ the largest eigenvalue of the mass matrix:
    // 0.107 kg m² of a and b, 0.041 of c.
    EXPECT_GT(sum, 0.03 - 1e-4);
    EXPECT_LT(sum, 0.03 + 0.0214);
    EXPECT_GT(of_joint[0], 0.02 - 1e-4);
    EXPECT_LT(of_joint[0], 0.02 + 0.0082);
  };
  for (const FullIntegrator integrator : {FullIntegrator::kEuler, FullIntegrator::kTwoStages}) {
    FullSimulation full = Start(scene, h, integrator);
    Advance(full, 1);
    check(full.Displacements(0), full.Displacements(1));
  }
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    SimulationOptions options;
    options.dt = h;
    options.step.integrator = integrator;
    auto reduced = Simulation::Create(scene, options);
    ASSERT_TRUE(reduced) << reduced.error().Text();
    for (int i = 0; i < static_cast<int>(std::lround(1 / h)); ++i)
      ASSERT_TRUE(reduced->Step().IsSolved()) << i;
    check(reduced->JointCoordinates(0), reduced->JointCoordinates(1));
  }
}

// A spatial tendon of the inverse mass W = r²/I is brought inside at 0.1 m/s times min(1, m W), m and I those of a mass at
// 0.2 m from the hinge: on both sides of m W = 1, in both simulators.
TEST_P(StartOutsideLimits, TendonOfALever_ComesInsideByItsInverseMass) {
  const double h = GetParam(), time = 0.1, at = 0.2;  // s, m
  for (const double lever : {0.1, 0.19, 0.21, 0.3}) {
    SCOPED_TRACE(lever);
    const Scene scene =
        Import(fmt::format(R"(<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
    <site name="top" pos="{0} 0 1"/><body name="arm"><joint name="j" axis="0 -1 0"/><site name="eye" pos="{0} 0 0"/>
    <inertial pos="{1} 0 0" mass="2" diaginertia="1e-9 1e-9 1e-9"/></body></worldbody><tendon>
    <spatial name="rope" limited="true" range="0 .95"><site site="top"/><site site="eye"/></spatial></tendon></mujoco>)",
                           lever, at));
    const double rate = 0.1 * std::min(1.0, lever * lever / (at * at)) / lever;  // rad/s
    // The lever turns by 0.05 rad at most, and its arm changes by the square of that.
    const auto check = [&](double turned) { EXPECT_NEAR(turned, rate * time, 5e-3 * rate * time); };
    for (const FullIntegrator integrator : {FullIntegrator::kEuler, FullIntegrator::kTwoStages}) {
      FullSimulation full = Start(scene, h, integrator);
      Advance(full, time);
      check(full.Displacements(0)[0]);
    }
    for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
      SimulationOptions options;
      options.dt = h;
      options.step.integrator = integrator;
      auto reduced = Simulation::Create(scene, options);
      ASSERT_TRUE(reduced) << reduced.error().Text();
      for (int i = 0; i < static_cast<int>(std::lround(time / h)); ++i)
        ASSERT_TRUE(reduced->Step().IsSolved()) << i;
      check(reduced->JointCoordinates(0)[0]);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Steps, StartOutsideLimits, ::testing::Values(1e-3, 4e-3, 1.0 / 120));

}  // namespace
}  // namespace fork1s::reference_test
