// Where motion comes to rest, against the equilibrium of the full mechanism.
#include <fork1s/mechanism/kinematics.hpp>
#include <fork1s/reduction/statics.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::MustCreate;

// Steps until nothing moves; the wrench, if any, is applied again in every step.
void Settle(World& world, const StepOptions& step, BodyIndex body = {},
            const Vector3& force = Vector3::Zero()) {
  MechanismDynamics& m = world.mechanisms()[0];
  for (int i = 0; i < 3000; ++i) {
    if (body.valid()) m.AddWrench(body, force, Vector3::Zero(), m.BodyPose(body).translation());
    ASSERT_TRUE(world.Step(step).finite);
  }
  ASSERT_LT(m.KineticEnergy(), 1e-16);
}

void ExpectPoses(const MechanismDynamics& m, const StaticsResult& expected, double tolerance) {
  ASSERT_TRUE(expected.converged);
  Kinematics kinematics(m.mechanism());
  ComputeKinematics(m.mechanism(), expected.q, kinematics);
  for (int b = 0; b < m.mechanism().num_bodies(); ++b) {
    const RigidTransform X = m.state().X_WR * kinematics.X_RB[static_cast<std::size_t>(b)];
    EXPECT_LT(Log(X.inverse() * m.BodyPose(BodyIndex(b))).norm(), tolerance)
        << m.mechanism().body(BodyIndex(b)).name;
  }
}

// Implicit Euler has the statics' equilibrium as its own; what is left is the decay of the slowest motion.
constexpr double kPose = 1e-6;

TEST(Rest, ConstantForceOnTheTip) {
  for (const int modes : {0, 2, 100}) {
    SCOPED_TRACE(modes);
    World::Options options;
    options.reduction.modes = modes;
    const MechanismDef definition = testing::Chain(8, 0.1, 0.1, 20, 1, true);
    World world = MustCreate(definition, options);
    MechanismDynamics& m = world.mechanisms()[0];
    const BodyIndex tip = m.mechanism().FindBody("tip");
    const Vector3 force(-2, 12, 5);
    Settle(world, testing::Still(), tip, force);
    ExpectPoses(m, SolveStatics(m.mechanism(), VectorX::Zero(8), {{tip, force}}), kPose);
    EXPECT_GT(MaxJointRotation(m.mechanism(), VectorX::Zero(8), m.configuration().q), 0.2);
  }
}

TEST(Rest, LoopUnderForce) {
  World world = MustCreate(testing::FourBar().Definition());
  MechanismDynamics& m = world.mechanisms()[0];
  const BodyIndex coupler = m.mechanism().FindBody("coupler");
  const Vector3 force(4, 1, 0);
  Settle(world, testing::Still(), coupler, force);
  ExpectPoses(m, SolveStatics(m.mechanism(), VectorX::Zero(3), {{coupler, force}}), kPose);
}

TEST(Rest, LegsThatAreNoInterfacesSag) {
  // Only the first foot is an interface: seven hinges of eight are interior, without modes.
  MechanismDef definition = testing::Walker(BaseKind::kFixed, 3, 0.1);
  definition.interfaces = {"shank0"};
  for (const int modes : {0, 2}) {
    SCOPED_TRACE(modes);
    World::Options options;
    options.reduction.modes = modes;
    World world = MustCreate(definition, options);
    MechanismDynamics& m = world.mechanisms()[0];
    StepOptions step;
    Settle(world, step);
    StaticsOptions statics;
    statics.gravity_R = step.gravity;
    const StaticsResult expected = SolveStatics(m.mechanism(), VectorX::Zero(8), {}, statics);
    EXPECT_GT(expected.q.cwiseAbs().maxCoeff(), 0.04);  // enough for the order of rotations to matter
    ExpectPoses(m, expected, kPose);
  }
}

TEST(Rest, SetPoints) {
  MechanismBuilder builder("finger");
  BodyIndex parent = builder.base();
  for (int i = 0; i < 3; ++i) {
    BodyDef link;
    link.name = "link" + std::to_string(i);
    link.parent = parent;
    link.X_PB = RigidTransform(Vector3(i == 0 ? 0 : 0.05, 0, 0));
    link.inertia = testing::Rod(0.05, 0.05);
    parent = builder.AddBody(link);
    const JointIndex joint = builder.AddJoint(
        JointDef::Hinge("joint" + std::to_string(i), parent, Vector3::UnitZ()).WithSpring(2, 0.1));
    ControlDef control;
    control.name = "servo" + std::to_string(i);
    control.terms.emplace_back(FreedomRef{joint, 0}, 1.0);
    control.gain = 2;
    control.is_setpoint = true;
    builder.AddControl(control);
  }
  builder.SetInterfaces({"link2"});
  World world = MustCreate(builder.definition());
  MechanismDynamics& m = world.mechanisms()[0];
  const Vector3 target = Vector3(60, -45, 30) * (M_PI / 180);
  m.controls() = target;
  for (int i = 0; i < 1200; ++i) world.Step(testing::Still());
  EXPECT_LT((m.configuration().q - target).cwiseAbs().maxCoeff(), 1e-8);
}

TEST(Rest, JointLimitsHold) {
  // A pendulum that gravity swings against its stop at 0.3 rad, and a free body thrown at nothing.
  MechanismBuilder builder("pendulum");
  BodyDef rod;
  rod.name = "rod";
  rod.parent = builder.base();
  rod.inertia = testing::Rod(1, 0.5);
  const BodyIndex b = builder.AddBody(rod);
  builder.AddJoint(JointDef::Hinge("pivot", b, Vector3::UnitY()).WithSpring(0, 0.01).WithLimits(-0.2, 0.3));
  builder.SetInterfaces({"rod"});
  World world = MustCreate(builder.definition());
  StepOptions step;
  double largest = 0;
  int at_limit = 0;
  for (int i = 0; i < 240; ++i) {
    at_limit += world.Step(step).limits > 0;
    largest = std::max(largest, world.mechanisms()[0].configuration().q(0));
  }
  const double q = world.mechanisms()[0].configuration().q(0);
  EXPECT_LT(largest, 0.3 + 2e-4);  // the slop
  EXPECT_NEAR(q, 0.3, 2e-4);
  EXPECT_GT(at_limit, 200);
  EXPECT_LT(std::abs(world.mechanisms()[0].state().w(0)), 1e-6);
  // Turned gravity: to the other stop.
  step.gravity = Vector3(0, 0, 9.81);
  for (int i = 0; i < 240; ++i) world.Step(step);
  EXPECT_NEAR(world.mechanisms()[0].configuration().q(0), -0.2, 2e-4);
}

}  // namespace
}  // namespace fork1s
