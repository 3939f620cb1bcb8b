// A stage that Newton's method does not solve is never accepted: the step is halved, or undone and reported. Of each
// case the mechanism is built here and varied in stiffness, time step, order and frame.
#include <cmath>
#include <stepping/support.hpp>

#include <allocation_counter.hpp>

namespace fork1s {
namespace {

using testing::MustCreate;
using testing::MustStart;

struct EnergyCourse {
  double first = 0, last = 0, most = 0;  // J, energy beside the work of pushes
  double most_kinetic = 0;               // J
  int halved = 0, unsolved = 0, saturations = 0, unconverged = 0, most_iterations = 0;
  bool finite = true;
};
std::ostream& operator<<(std::ostream& out, const EnergyCourse& c) {
  return out << "energy " << c.first << " to " << c.last << ", at most " << c.most << ", kinetic at most "
             << c.most_kinetic << ", halved " << c.halved << " (unsolved " << c.unsolved << ", saturation "
             << c.saturations << "), unconverged " << c.unconverged << ", iterations at most "
             << c.most_iterations << (c.finite ? "" : ", NOT FINITE");
}

// `push` [N] on the last body through the steps of `from` to `to` [s].
struct PushInTime {
  Vector3 force = Vector3::Zero();
  double from = 0, to = 0;
};

EnergyCourse RunFor(World& world, const StepOptions& step, double time, const PushInTime& push = {}) {
  MechanismDynamics& m = world.mechanisms()[0];
  const BodyIndex last(m.mechanism().num_bodies() - 1);
  EnergyCourse c;
  double work = 0;
  c.first = c.most = world.KineticEnergy() + world.PotentialEnergy(step.gravity);
  const int steps = static_cast<int>(std::lround(time / step.h));
  for (int i = 0; i < steps; ++i) {
    const Vector3 at = m.BodyPose(last).translation();
    const bool pushes = i * step.h >= push.from && i * step.h < push.to;
    if (pushes) m.AddWrench(last, push.force, Vector3::Zero(), at);
    const StepReport report = world.Step(step);
    if (!report.finite) {
      c.finite = false;
      break;
    }
    if (pushes) work += push.force.dot(m.BodyPose(last).translation() - at);
    c.halved += report.parts > 1 ? 1 : 0;
    c.unsolved += report.halving == HalvingCause::kUnsolved ? 1 : 0;
    c.saturations += report.halving == HalvingCause::kSaturation ? 1 : 0;
    c.unconverged += report.stages_converged ? 0 : 1;
    c.most_iterations = std::max(c.most_iterations, report.max_stage_iterations);
    c.most_kinetic = std::max(c.most_kinetic, world.KineticEnergy());
    c.last = world.KineticEnergy() + world.PotentialEnergy(step.gravity) - work;
    c.most = std::max(c.most, c.last);
  }
  return c;
}

World::Options AllModes() {
  World::Options options;
  options.reduction.modes = 100;
  return options;
}

// Links that hang from one end and fall from straight, in a frame that is turned.
TEST(UnsolvedStage, ASoftChainThatFallsGainsNoEnergy) {
  for (const int links : {10, 30})
    for (const double stiffness : {0.05, 0.5})
      for (const double h : {1.0 / 60, 1.0 / 240})
        for (const double turn : {0.0, 0.7}) {
          SCOPED_TRACE(std::to_string(links) + " links, " + std::to_string(stiffness) + " N m/rad, h " +
                       std::to_string(h) + ", turned " + std::to_string(turn));
          MechanismDef chain = testing::Chain(links, 0.9 / links, 0.6 / links, stiffness, 0.01 * stiffness);
          const Matrix3 R = ExpRotation(Vector3(0.3 * turn, -0.5 * turn, turn));
          chain.X_WR = RigidTransform(R, Vector3(0.1, 0.2, 0.3));
          World world = MustCreate(chain, AllModes());
          const EnergyCourse c = RunFor(world, testing::TwoStage(h, R * Vector3(0, -9.81, 0)), 1);
          EXPECT_TRUE(c.finite);
          EXPECT_LT(c.most - c.first, 1e-2 * c.most_kinetic) << c;
        }
}

// A ball that hangs from light links by hinges and swings as on a rod: its weight stretches the links, a stiffness
// that neither springs nor inertia know.
TEST(UnsolvedStage, AHeavyBallOnLightLinksSwingsAsAPendulum) {
  for (const double mass_ratio : {1e3, 1e5})
    for (const double length : {0.1, 1.0, 10.0})
      for (const double turn : {0.0, 0.7}) {
        SCOPED_TRACE(::testing::Message()
                     << "mass ratio " << mass_ratio << ", " << length << " m, turned " << turn);
        const double mass = 2, start = 0.02, time = 1, rate = std::sqrt(9.81 / length);
        MechanismDef chain = testing::Chain(3, length / 3, mass / mass_ratio, 1e-7 * mass * 9.81 * length, 0);
        chain.bodies.back().inertia = testing::Ball(mass, 1e-3 * length);
        const Matrix3 R = ExpRotation(Vector3(0.3 * turn, -0.5 * turn, turn));
        chain.X_WR = RigidTransform(R, Vector3(0.1, 0.2, 0.3));
        double error[2];
        for (const int halved : {0, 1}) {
          const double h = halved ? 1.0 / 120 : 1.0 / 60;
          World world = MustStart(chain, Vector3(start, 0, 0), VectorX::Zero(3), Vector6::Zero(), AllModes());
          const EnergyCourse c = RunFor(world, testing::TwoStage(h, R * Vector3(9.81, 0, 0)), time);
          EXPECT_TRUE(c.finite && c.halved == 0 && c.unconverged == 0) << c;
          const MechanismDynamics& m = world.mechanisms()[0];
          const Vector3 tip =
              chain.X_WR.inverse() * m.BodyPose(BodyIndex(m.mechanism().num_bodies() - 1)).translation();
          error[halved] = std::abs(std::atan2(tip.y(), tip.x()) / start - std::cos(rate * time));
        }
        // Of second order; the links are not without mass, and a swing of 0.02 rad is slower by 2.5e-5.
        const double rest = (1 / mass_ratio + start * start) * rate * time;
        EXPECT_LT(error[0], 0.1 * std::pow(rate / 60, 2) * rate * time + rest);
        EXPECT_LT(error[1], 0.3 * error[0] + rest);
      }
}

// A push that folds an arm up.
TEST(UnsolvedStage, AHardPushGivesAnArmNoMoreThanItsWork) {
  for (const double stiffness : {0.3, 3.0})
    for (const double force : {2.0, 10.0})
      for (const double h : {1.0 / 60, 1.0 / 120}) {
        World world = MustCreate(testing::Chain(30, 0.03, 0.02, stiffness, 0.0067 * stiffness), AllModes());
        const EnergyCourse c =
            RunFor(world, testing::TwoStage(h, Vector3(0, -9.81, 0)), 2, {Vector3(0, -force, 0), 0.2, 0.5});
        EXPECT_TRUE(c.finite);
        // The scheme's own error, and that of a push whose lever is that of the start of the step: they fall with the
        // square of the step.
        EXPECT_LT(c.most - c.first, 0.4 * std::pow(60 * h, 2) * c.most_kinetic) << c;
      }
}

TEST(UnsolvedStage, ThreeLinksThatSpinFastGainNoEnergy) {
  for (const bool spatial : {false, true})
    for (const double sign : {1.0, -1.0})
      for (const double h : {1.0 / 60, 1.0 / 240, 1.0 / 960}) {
        VectorX q_dot(3);
        q_dot << 50, sign * 50, 50;
        World world = MustStart(testing::Chain(3, 0.25, 1, 20, 0, spatial), VectorX::Zero(3), q_dot,
                                Vector6::Zero(), AllModes());
        const EnergyCourse c = RunFor(world, testing::TwoStage(h, testing::kDown), 1);
        EXPECT_TRUE(c.finite);
        // The last link turns by 1 to 2.5 rad in a step of 1/60 s, where SDIRK2 gains up to 8 %.
        EXPECT_LT(c.most - c.first, (h > 0.01 ? 0.1 : h > 0.002 ? 0.02 : 3e-3) * c.most_kinetic) << c;
      }
}

TEST(UnsolvedStage, ASpinningTopGainsNoEnergy) {
  for (const double spin : {30.0, 100.0, 300.0})
    for (const double h : {1.0 / 60, 1.0 / 240}) {
      MechanismBuilder builder("top");
      BodyDef top;
      top.name = "top";
      top.parent = builder.base();
      top.inertia = testing::Brick(1, Vector3(0.1, 0.1, 0.02));
      top.inertia.center = Vector3(0, 0, 0.1);
      const BodyIndex b = builder.AddBody(top);
      builder.AddJoint(JointDef::Ball("foot", b));
      builder.SetInterfaces({"top"});
      World world = MustStart(builder.definition(), Vector3(0.3, 0, 0),
                              ExpRotation(Vector3(0.3, 0, 0)) * Vector3(0, 0, spin));
      const EnergyCourse c = RunFor(world, testing::TwoStage(h, testing::kDown), 1);
      EXPECT_TRUE(c.finite);
      EXPECT_LT(c.most - c.first, 1e-3 * c.most_kinetic) << c;
    }
}

// A link that falls past the set-point of a servo so stiff that it is at one of its bounds or the other nearly always.
TEST(UnsolvedStage, AStiffServoThatComesOffItsBoundGivesNoEnergy) {
  for (const double stiffness : {1e3, 1e5, 1e7, 1e9})
    for (const double bound : {10.0, 100.0})
      for (const double h : {1.0 / 60, 1.0 / 120}) {
        MechanismDef arm = testing::Chain(1, 0.5, 1, 0);
        arm.joints[0].WithSpring(0, 0);
        ControlDef target;
        target.name = "target";
        target.terms.emplace_back(FreedomRef{JointIndex(0), 0}, 1.0);
        target.gain = stiffness;
        target.is_setpoint = true;
        arm.controls.push_back(target);
        arm.springs.push_back({"servo", {{FreedomRef{JointIndex(0), 0}, 1.0}}, stiffness, 0, 0, {}});
        ForceLimitDef limit;
        limit.name = "servo";
        limit.terms.emplace_back(FreedomRef{JointIndex(0), 0}, 1.0);
        limit.inputs.emplace_back("target", 1.0);
        limit.stiffness = stiffness;
        limit.lower = -bound;
        limit.upper = bound;
        arm.force_limits.push_back(limit);
        World world = MustStart(arm, VectorX::Constant(1, 1.5), VectorX::Constant(1, -20));
        const EnergyCourse c = RunFor(world, testing::TwoStage(h, Vector3(0, -9.81, 0)), 2);
        EXPECT_TRUE(c.finite);
        EXPECT_GT(c.saturations, 0);
        // Extrapolated, the force at the bound gave up to 240 J.
        EXPECT_LT(c.most - c.first, 2e-2 * c.most_kinetic) << c;
      }
}

// A push that nothing can follow, also where it leaves the range of numbers at once: the step is undone, and
// the report says of what.
TEST(UnsolvedStage, AStepThatCannotBeSolvedIsUndoneAndReported) {
  for (const double force : {1e12, 1e160, 1e200, 1e300}) {
    SCOPED_TRACE(force);
    World world = MustCreate(testing::Chain(10, 0.09, 0.06, 0.05), AllModes());
    MechanismDynamics& m = world.mechanisms()[0];
    WorldState before, after;
    world.Save(before);
    m.AddWrench(BodyIndex(m.mechanism().num_bodies() - 1), Vector3(0.3, force, 0.2), Vector3::Zero(),
                Vector3(0.9, 0, 0));
    const StepReport report = world.Step(testing::TwoStage(1.0 / 60, testing::kDown));
    EXPECT_FALSE(report.finite);
    EXPECT_FALSE(report.stages_converged);
    EXPECT_EQ(world.NameOf(report.halving_of), "mechanism 'chain'");
    world.Save(after);
    EXPECT_EQ(HashOf(after), HashOf(before));
    EXPECT_TRUE(world.Step(testing::TwoStage(1.0 / 60, testing::kDown)).finite);
  }
}

// Halved steps depend on nothing but the state, and once warm allocate nothing.
TEST(UnsolvedStage, HalvedStepsAreReproducibleAndDoNotAllocate) {
  const MechanismDef chain = testing::Chain(20, 0.045, 0.03, 0.05, 0.0005);
  World world = MustCreate(chain, AllModes()), other = MustCreate(chain, AllModes());
  StepOptions step = testing::TwoStage(1.0 / 60, Vector3(0, -9.81, 0));
  step.refresh = false;
  for (int i = 0; i < 20; ++i) world.Step(step);
  WorldState saved, end, again;
  world.Save(saved);
  int unsolved = 0;
  for (int i = 0; i < 40; ++i) unsolved += world.Step(step).halving == HalvingCause::kUnsolved ? 1 : 0;
  EXPECT_GT(unsolved, 0);
  world.Save(end);
  other.Restore(saved);
  for (int i = 0; i < 40; ++i) other.Step(step);
  other.Save(again);
  EXPECT_EQ(HashOf(end), HashOf(again));
  world.Restore(saved);
  const long before = testing::allocations.load();
  for (int i = 0; i < 40; ++i) world.Step(step);
  EXPECT_EQ(testing::allocations.load(), before);
}

}  // namespace
}  // namespace fork1s
