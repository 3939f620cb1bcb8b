// Springs that are slack over a range of their length.
#include <gtest/gtest.h>

#include <cmath>
#include <fork1s/mechanism/builder.hpp>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "support.hpp"

namespace fork1s {
namespace {

constexpr double kPuckMass = 2, kPlay = 0.1, kPuckSpeed = 1;  // kg, m to either side of the start, m/s

// A puck on a rail along x, free between the ends of a spring with play.
MechanismDef Puck(double stiffness, double damping = 0) {
  MechanismBuilder builder("puck");
  BodyDef body;
  body.name = "puck";
  body.parent = builder.base();
  body.inertia = testing::Ball(kPuckMass, 0.1);
  const BodyIndex b = builder.AddBody(body);
  const JointIndex rail = builder.AddJoint(JointDef::Slide("rail", b, Vector3::UnitX()));
  SpringDef spring;
  spring.name = "buffer";
  spring.terms = {{{rail, 0}, 1.0}};
  spring.stiffness = stiffness;
  spring.damping = damping;
  spring.rest = -kPlay;
  spring.slack = 2 * kPlay;
  builder.AddSpring(spring);
  builder.SetInterfaces({"puck"});
  return builder.definition();
}

double PuckAt(const World& world) { return world.mechanisms()[0].configuration().q(0); }
double PuckSpeed(const World& world) {
  return world.mechanisms()[0].BodyVelocity(world.mechanisms()[0].mechanism().FindBody("puck"))(3);
}

double PuckEnergy(const World& world, double stiffness) {
  const double beyond = std::max(std::abs(PuckAt(world)) - kPlay, 0.0), v = PuckSpeed(world);
  return 0.5 * kPuckMass * v * v + 0.5 * stiffness * beyond * beyond;
}

// Where it is that starts in the middle at kPuckSpeed: free flights and half swings in turn.
double PuckTruth(double stiffness, double t) {
  const double omega = std::sqrt(stiffness / kPuckMass), swing = std::numbers::pi / omega,
               flight = 2 * kPlay / kPuckSpeed;
  double sign = 1;
  for (t += flight / 2; t > flight + swing; t -= flight + swing) sign = -sign;
  const double x =
      t < flight ? kPuckSpeed * t - kPlay : kPlay + kPuckSpeed / omega * std::sin(omega * (t - flight));
  return sign * x;
}

World StartPuck(double stiffness) {
  return testing::MustStart(Puck(stiffness), VectorX::Zero(1), VectorX::Constant(1, kPuckSpeed));
}

struct Bounces {
  double most = 0, least = 1e300;  // of the energy, as shares of that of the start
  int turns = 0;
};

Bounces Bounce(double stiffness, const StepOptions& step, double seconds) {
  World world = StartPuck(stiffness);
  Bounces out;
  const double start = PuckEnergy(world, stiffness);
  double before = start, speed = kPuckSpeed;
  for (int i = 0; i * step.h < seconds; ++i) {
    EXPECT_TRUE(world.Step(step).finite);
    const double energy = PuckEnergy(world, stiffness);
    EXPECT_NEAR(world.KineticEnergy() + world.PotentialEnergy(step.gravity), energy, 1e-12 * start);
    if (step.integrator == Integrator::kEuler) {
      EXPECT_LE(energy, before + 1e-12 * start) << i;
    }
    before = energy;
    out.most = std::max(out.most, energy / start);
    out.least = std::min(out.least, energy / start);
    out.turns += speed * PuckSpeed(world) < 0 ? 1 : 0;
    speed = PuckSpeed(world);
  }
  return out;
}

// A step of implicit Euler gains nothing where it enters or leaves the range, however stiff the ends.
TEST(SlackSpring, NeverGainsByImplicitEuler) {
  for (const double stiffness : {80.0, 800.0, 8e4, 8e8}) {
    SCOPED_TRACE(stiffness);
    EXPECT_LE(Bounce(stiffness, testing::BackwardEuler(), 20).most, 1 + 1e-12);
  }
}

// Nor by second order, which looks for the end of a step again where a stiff end is met within it.
TEST(SlackSpring, NeverGainsBySecondOrder) {
  StepOptions step = testing::Still();
  step.integrator = Integrator::kTwoStage;
  for (const double stiffness : {8e4, 8e6, 8e8}) {
    SCOPED_TRACE(stiffness);
    EXPECT_LE(Bounce(stiffness, step, 20).most, 1 + 1e-9);
  }
}

// Nor does it lose more than implicit Euler takes of a swing, h ω of the energy in each radian, and the free
// flights nothing.
TEST(SlackSpring, LosesNoMoreThanHalfASwingLoses) {
  constexpr double kStiffness = 800, kStep = 1e-4;  // ω = 20 1/s: half a swing in 0.157 s
  const Bounces b = Bounce(kStiffness, testing::BackwardEuler(kStep), 20);
  EXPECT_NEAR(b.turns, 20 / (2 * kPlay + std::numbers::pi / 20), 4);  // it grows slower
  const double loss = 1 - std::exp(-kStep * 20 * std::numbers::pi * b.turns);
  EXPECT_LT(1 - b.least, 1.1 * loss);
  EXPECT_GT(1 - b.least, 0.3 * loss);
}

TEST(SlackSpring, LosesLittleBySecondOrder) {
  for (const double stiffness : {80.0, 800.0, 3000.0}) {
    SCOPED_TRACE(stiffness);
    double lost[2];
    for (const bool fine : {false, true}) {
      StepOptions step = testing::Still(fine ? 1.0 / 240 : 1.0 / 60);
      step.integrator = Integrator::kTwoStage;
      const Bounces b = Bounce(stiffness, step, 20);
      EXPECT_LT(b.most, 1 + 1e-9);
      EXPECT_GT(b.turns, 15);
      lost[fine] = 1 - b.least;
    }
    EXPECT_LT(lost[0], 0.6);
    EXPECT_LT(lost[1], 0.3 * lost[0]);
  }
}

// Free flight and half a swing in turn, in closed form.
TEST(SlackSpring, GoesToAndFroAsItsEquationsSay) {
  for (const Integrator by : {Integrator::kEuler, Integrator::kTwoStage}) {
    double error[2];
    for (int halved = 0; halved < 2; ++halved) {
      World world = StartPuck(800);
      StepOptions step = testing::Still(2e-4 / (1 << halved));
      step.integrator = by;
      const int count = static_cast<int>(std::lround(3 / step.h));
      for (int i = 0; i < count; ++i) ASSERT_TRUE(world.Step(step).finite);
      error[halved] = std::abs(PuckAt(world) - PuckTruth(800, 3));
    }
    EXPECT_LT(error[0], by == Integrator::kTwoStage ? 1e-5 : 0.05);
    EXPECT_LT(error[1], (by == Integrator::kTwoStage ? 0.3 : 0.55) * error[0]);
  }
}

constexpr double kRopeBlock = 2, kRopeLoad = 3, kRopeGravity = 9.81;  // kg, kg, m/s²

// A rope from a beam down to a block, of which half counts, and over a pulley down to a load; just taut. Both
// move along z of a frame that is turned by R.
MechanismDef RopeOverPulleys(double stiffness, bool block_first, const Matrix3& R) {
  MechanismBuilder builder("rope");
  BodyIndex block, load;
  for (const bool is_block : {block_first, !block_first}) {
    BodyDef body;
    body.name = is_block ? "block" : "load";
    body.parent = builder.base();
    body.X_PB = RigidTransform(is_block ? Vector3(0, 0, -1.6) : Vector3(0.5, 0, -1.8));
    body.inertia = testing::Ball(is_block ? kRopeBlock : kRopeLoad, 0.05);
    const BodyIndex b = builder.AddBody(body);
    builder.AddJoint(JointDef::Slide(body.name, b, Vector3::UnitZ()));
    (is_block ? block : load) = b;
  }
  builder.SetInterfaces({"block", "load"});
  MechanismDef def = builder.definition();
  def.X_WR = RigidTransform(R, Vector3(0.1, -0.2, 3));
  const auto point = [](BodyIndex body, const Vector3& p_B) {
    PathElementDef e;
    e.body = body;
    e.X_BE = RigidTransform(p_B);
    return e;
  };
  const auto pulley = [](double divisor) {
    PathElementDef e;
    e.kind = PathElementDef::Kind::kPulley;
    e.divisor = divisor;
    return e;
  };
  def.paths.push_back({"rope",
                       {pulley(2), point(builder.base(), Vector3::Zero()), point(block, Vector3::Zero()),
                        pulley(1), point(builder.base(), Vector3(0.5, 0, 0)), point(load, Vector3::Zero())}});
  SpringDef rope;
  rope.name = "rope";
  rope.stiffness = stiffness;
  rope.along = {0, 1};
  rope.slack = 0.5 * 1.6 + 1.8;  // m, its length at the start
  rope.rest = -rope.slack;
  def.springs.push_back(rope);
  return def;
}

// A rope of length b/2 + a that is taut: b'' / 2 + a'' = 0 with block b'' = g - T/(2 m_b) and load a'' = g -
// T/m_a. Taken as slack it let the block fall freely to its pulley's end.
TEST(SlackSpring, ARopeOverPulleysMovesBothLoadsByItsRatio) {
  const double give = 1 / (4 * kRopeBlock) + 1 / kRopeLoad, tension = 1.5 * kRopeGravity / give;
  const double block =
      -1.6 - 0.5 * (kRopeGravity - tension / (2 * kRopeBlock));  // m, after 1 s, of a rope that is rigid
  const double load = -1.8 - 0.5 * (kRopeGravity - tension / kRopeLoad);
  for (const double stiffness : {2e5, 2e7})
    for (const double h : {1.0 / 30, 1.0 / 60, 1.0 / 240})
      for (const bool block_first : {true, false})
        for (const Matrix3& R : {Matrix3(Matrix3::Identity()), ExpRotation(Vector3(0.4, -0.7, 1.1))}) {
          SCOPED_TRACE(::testing::Message()
                       << stiffness << " N/m, h " << h << ", block first " << block_first);
          World world = testing::MustCreate(RopeOverPulleys(stiffness, block_first, R));
          MechanismDynamics& m = world.mechanisms()[0];
          const StepOptions step = testing::TwoStage(h, R * Vector3(0, 0, -kRopeGravity));
          const double start = world.PotentialEnergy(step.gravity);
          double most = start;
          for (int i = 0; i < std::lround(1 / h); ++i) {
            ASSERT_TRUE(world.Step(step).stages_converged) << i;
            most = std::max(most, world.KineticEnergy() + world.PotentialEnergy(step.gravity));
          }
          const auto height = [&](const char* name) {
            return (m.state().X_WR.inverse() * m.BodyPose(m.mechanism().FindBody(name))).translation().z();
          };
          // The rope stretches by T/k, of which the block takes 1/(2 m_b) and the load 1/m_a of `give`, and
          // swings about that by as much at most.
          const double stretch = tension / stiffness / give;
          EXPECT_NEAR(height("block"), block - stretch / (2 * kRopeBlock), stretch / (2 * kRopeBlock));
          EXPECT_NEAR(height("load"), load - stretch / kRopeLoad, stretch / kRopeLoad);
          EXPECT_LT(most - start, 1e-9 * tension);
        }
}

// The reduction and the compliance see no spring within the range, and the whole of it beyond.
TEST(SlackSpring, HoldsBeyondItsRangeOnly) {
  const auto m = testing::Share(Puck(800));
  for (const auto& [q, k] : {std::pair(0.0, 0.0), {0.05, 0.0}, {0.15, 800.0}, {-0.2, 800.0}}) {
    Kinematics kinematics(*m);
    const VectorX at = VectorX::Constant(1, q);
    ComputeKinematics(*m, at, kinematics);
    EXPECT_EQ(StiffnessMatrix(*m, kinematics, at)(0, 0), k) << q;
    const auto model = Reduce(m, at);
    ASSERT_TRUE(model);
    EXPECT_EQ(model->K_r(0), k == 0 ? 0 : 1) << q;
  }
}

// Pushed by its weight it leaves the range and rests where the end bears it; the damper works all the way.
TEST(SlackSpring, RestsOnItsEnd) {
  for (const Integrator by : {Integrator::kEuler, Integrator::kTwoStage}) {
    World world = testing::MustCreate(Puck(800, 20));
    StepOptions step;
    step.integrator = by;
    step.gravity = Vector3(2, 0, 0);
    ASSERT_TRUE(world.Step(step).finite);
    EXPECT_NEAR(PuckSpeed(world), step.h * 2, step.h * 2 * 0.2);
    for (int i = 0; i < 1200; ++i) ASSERT_TRUE(world.Step(step).finite);
    EXPECT_NEAR(PuckAt(world), kPlay + 2 * kPuckMass / 800, 1e-9);
  }
}

// Sliders in a row, each with play towards its neighbour and towards the one after that.
MechanismDef Row(std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(0, 1);
  MechanismBuilder builder("row");
  std::vector<JointIndex> rails;
  std::vector<std::string> names;
  for (int k = 0; k < 6; ++k) {
    BodyDef body;
    body.name = "slider " + std::to_string(k);
    body.parent = builder.base();
    body.inertia = testing::Ball(std::pow(10, 2 * uniform(random) - 1), 0.1);
    const BodyIndex b = builder.AddBody(body);
    rails.push_back(builder.AddJoint(JointDef::Slide("rail " + std::to_string(k), b, Vector3::UnitX())));
    names.push_back(body.name);
  }
  for (std::size_t reach = 1; reach <= 2; ++reach)
    for (std::size_t k = 0; k + reach < rails.size(); ++k) {
      SpringDef spring;
      spring.name = "spring " + std::to_string(reach) + " " + std::to_string(k);
      spring.terms = {{{rails[k], 0}, 1.0}, {{rails[k + reach], 0}, -2 * uniform(random)}};
      spring.stiffness = std::pow(10, 2 + 7 * uniform(random));
      spring.rest = -0.01 * uniform(random);
      spring.slack = 0.02 * uniform(random) + 1e-4;
      builder.AddSpring(spring);
    }
  builder.SetInterfaces(names);
  return builder.definition();
}

// Which springs bear at the end of a step is found however many change sides at once, and loses no energy to
// a step that is not solved.
TEST(SlackSpring, ManyChangeSidesInOneStep) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 100; ++trial) {
    SCOPED_TRACE(trial);
    const MechanismDef def = Row(random);
    VectorX speeds(6);
    for (double& v : speeds) v = std::uniform_real_distribution<double>(-3, 3)(random);
    for (const Integrator by : {Integrator::kEuler, Integrator::kTwoStage}) {
      World world = testing::MustStart(def, VectorX::Zero(6), speeds);
      StepOptions step = testing::Still();
      step.integrator = by;
      double most = world.KineticEnergy() + world.PotentialEnergy(step.gravity);
      for (int i = 0; i < 30; ++i) {
        const StepReport report = world.Step(step);
        ASSERT_TRUE(report.finite && report.stages_converged) << i;
        EXPECT_TRUE(report.IsSolved()) << i;
        if (by == Integrator::kEuler) {
          const double energy = world.KineticEnergy() + world.PotentialEnergy(step.gravity);
          EXPECT_LE(energy, most * (1 + 1e-9)) << i;  // rounding of forces of 1e7 N
          most = energy;
        }
      }
    }
  }
}

}  // namespace
}  // namespace fork1s
