// Stops, bounds of servos and dry friction of joints that the interface does not feel.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "support.hpp"

namespace fork1s {
namespace {

constexpr double kStop = 0.2617993877991494;  // rad
constexpr int kTailLinks = 10;

// A tail of ten links of 50 mm and 16 g that its weight bends, with its tip as the interface.
MechanismDef Tail(double stiffness, double damping, int modes = 4) {
  MechanismBuilder builder("tail");
  BodyIndex parent = builder.base();
  for (int i = 0; i < kTailLinks; ++i) {
    BodyDef link;
    link.name = "l" + std::to_string(i + 1);
    link.parent = parent;
    link.X_PB = RigidTransform(Vector3(0.05, 0, 0));
    link.inertia = testing::Rod(0.016, 0.05);
    parent = builder.AddBody(link);
    builder.AddJoint(JointDef::Hinge("t" + std::to_string(i + 1), parent, Vector3::UnitY())
                         .WithSpring(stiffness, damping)
                         .WithArmature(1e-5)
                         .WithLimits(-kStop, kStop));
  }
  builder.SetInterfaces({"l10"});
  MechanismDef def = builder.definition();
  def.modes = modes;
  return def;
}

World AfterTwoSeconds(const MechanismDef& def, Integrator integrator, double* beyond = nullptr) {
  World world = testing::MustCreate(def);
  StepOptions options;
  options.integrator = integrator;
  for (int i = 0; i < 120; ++i) {
    EXPECT_TRUE(world.Step(options).finite);
    if (beyond)
      *beyond = std::max(*beyond, world.mechanisms()[0].configuration().q.cwiseAbs().maxCoeff() - kStop);
  }
  return world;
}

TEST(InteriorStops, HoldWhateverTheSpringsAndDampers) {
  for (const double stiffness : {1e-5, 1e-4, 1e-2, 0.3, 3.0, 100.0})
    for (const double damping : {0.005, 0.05, 0.5})
      for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
        double beyond = 0;
        const World world = AfterTwoSeconds(Tail(stiffness, damping), integrator, &beyond);
        double of_whole = 0;
        AfterTwoSeconds(Tail(stiffness, damping, kTailLinks), integrator, &of_whole);
        // Impacts on stops go as far beyond them as those of the whole mechanism.
        EXPECT_LT(beyond, std::max(0.01 * 2 * kStop, 1.01 * of_whole))
            << stiffness << " N·m/rad, " << damping << " N·m·s/rad";
      }
}

TEST(InteriorStops, RestAsTheWholeMechanismDoes) {
  for (const double stiffness : {1e-4, 1e-2, 0.3}) {
    const World reduced = AfterTwoSeconds(Tail(stiffness, 0.05), Integrator::kEuler),
                whole = AfterTwoSeconds(Tail(stiffness, 0.05, kTailLinks), Integrator::kEuler);
    EXPECT_LT((reduced.mechanisms()[0].configuration().q - whole.mechanisms()[0].configuration().q).norm(),
              1e-6)
        << stiffness;
  }
}

TEST(InteriorStops, StiffJointsStayCondensed) {
  World world = testing::MustCreate(Tail(100, 0.05));
  const ReducedModel& model = world.mechanisms()[0].model();
  EXPECT_TRUE(model.has_complement);
  EXPECT_LT(model.size(), kTailLinks);
  EXPECT_TRUE(model.interior_stops.empty());
  EXPECT_TRUE(world.mechanisms()[0].warnings().empty());
}

TEST(InteriorStops, TheModelNamesTheJointThatKeepsItsGroup) {
  World world = testing::MustCreate(Tail(1e-4, 0.05));
  const ReducedModel& model = world.mechanisms()[0].model();
  EXPECT_EQ(model.size(), kTailLinks);
  ASSERT_FALSE(model.warnings.empty());
  EXPECT_NE(model.warnings[0].find("joint 't1' and 9 other stops"), std::string::npos) << model.warnings[0];
}

TEST(InteriorStops, GroupsThatReachNoneStayCondensed) {
  // A soft and a stiff tail on one base.
  MechanismDef def = Tail(1e-4, 0.05);
  const MechanismDef stiff = Tail(100, 0.05);
  for (std::size_t b = 1; b < stiff.bodies.size(); ++b) {
    BodyDef body = stiff.bodies[b];
    body.name = "s" + body.name;
    if (body.parent.value() > 0) body.parent = BodyIndex(body.parent.value() + kTailLinks);
    def.bodies.push_back(body);
    JointDef joint = stiff.joints[b - 1];
    joint.name = "s" + joint.name;
    joint.body = BodyIndex(joint.body.value() + kTailLinks);
    def.joints.push_back(joint);
  }
  def.interfaces = {"l10", "sl10"};
  World world = testing::MustCreate(def);
  const ReducedModel& model = world.mechanisms()[0].model();
  EXPECT_EQ(model.interior_stops.size(), 10u);
  EXPECT_TRUE(model.has_complement);
  EXPECT_LT(model.size(), 2 * kTailLinks);
  EXPECT_GE(model.size(), kTailLinks);
}

TEST(InteriorStops, ServosAtTheirBoundsAndDryFrictionAreKeptToo) {
  MechanismDef def = Tail(0.3, 0.05);
  for (JointDef& joint : def.joints) joint.WithLimits(-INFINITY, INFINITY);
  EXPECT_TRUE(testing::MustCreate(def).mechanisms()[0].model().has_complement);
  MechanismDef servo = def;
  ForceLimitDef limit;
  limit.name = "servo";
  limit.terms = {{FreedomRef{JointIndex(4), 0}, 1.0}};
  limit.stiffness = 0.3;
  limit.lower = -1e-3;
  limit.upper = 1e-3;
  servo.force_limits.push_back(limit);
  EXPECT_FALSE(testing::MustCreate(servo).mechanisms()[0].model().has_complement);
  servo.force_limits[0].lower = -100;
  servo.force_limits[0].upper = 100;
  EXPECT_TRUE(testing::MustCreate(servo).mechanisms()[0].model().has_complement);
  MechanismDef rough = def;
  rough.frictions.push_back({"pin", {{FreedomRef{JointIndex(4), 0}, 1.0}}, 0.2, {}});
  EXPECT_FALSE(testing::MustCreate(rough).mechanisms()[0].model().has_complement);
  rough.frictions[0].force = 1e-6;
  EXPECT_TRUE(testing::MustCreate(rough).mechanisms()[0].model().has_complement);
}

// A chain of 20 light links and 0.5 m with its tip as the interface.
MechanismDef PulledChain(int modes) {
  MechanismDef chain = testing::Chain(20, 0.025, 0.01, 80, 0.8);
  chain.modes = modes;
  chain.modes_by_step = false;
  return chain;
}

struct Hysteresis {
  double error = 0;      // of a body, as a share of the length, at any time
  double effect = 0;     // the same of the model without bound or friction
  double released = 0;   // rad in the joint, at the end
  bool reaches = false;  // the bound, or slides
  bool truncated = false;
};

// A pull across the tenth body, up within 4 s, down within the next four, and a second of rest.
Hysteresis PullUpAndDown(const std::function<void(MechanismDef&)>& add, int modes, Integrator integrator) {
  Hysteresis h;
  MechanismDef defs[3] = {PulledChain(modes), PulledChain(20), PulledChain(20)};
  add(defs[0]);
  add(defs[1]);
  World worlds[3] = {testing::MustCreate(defs[0]), testing::MustCreate(defs[1]),
                     testing::MustCreate(defs[2])};
  h.truncated = true;
  StepOptions step = testing::Still();
  step.integrator = integrator;
  for (int i = 1; i <= 540; ++i) {
    const double pull = 40 * std::max(0.0, 1 - std::abs(i / 240.0 - 1));  // N
    for (World& world : worlds) {
      MechanismDynamics& m = world.mechanisms()[0];
      m.AddWrench(BodyIndex(10), Vector3(0, pull, 0), Vector3::Zero(),
                  m.BodyPose(BodyIndex(10)).translation());
      const StepReport report = world.Step(step);
      EXPECT_TRUE(report.finite && report.stages_converged) << i;
      if (&world == &worlds[1]) h.reaches |= report.forces_at_bound > 0;
    }
    h.truncated &= worlds[0].mechanisms()[0].model().has_complement;
    for (int b = 0; b < 21; ++b) {
      const auto at = [&](int w) { return worlds[w].mechanisms()[0].BodyPose(BodyIndex(b)).translation(); };
      h.error = std::max(h.error, (at(0) - at(1)).norm() / 0.5);
      h.effect = std::max(h.effect, (at(2) - at(1)).norm() / 0.5);
    }
  }
  h.released = worlds[1].mechanisms()[0].configuration().q(4);
  return h;
}

TEST(InteriorStops, BoundOfAServoActsUnderLoadColumnsAsOnAllJoints) {
  const auto add = [](MechanismDef& chain) {  // half of the joint's stiffness is the servo's
    ForceLimitDef servo;
    servo.name = "servo";
    servo.terms = {{FreedomRef{JointIndex(4), 0}, 1.0}};
    servo.stiffness = 40;
    servo.lower = -1;
    servo.upper = 1;
    chain.force_limits.push_back(servo);
  };
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    const Hysteresis h = PullUpAndDown(add, 2, integrator);
    EXPECT_TRUE(h.truncated && h.reaches);
    EXPECT_GT(h.effect, 0.01);
    EXPECT_LT(h.error, 1e-3);
  }
}

TEST(InteriorStops, DryFrictionActsUnderLoadColumnsAsOnAllJoints) {
  const auto add = [](MechanismDef& chain) {
    chain.frictions.push_back({"pin", {{FreedomRef{JointIndex(4), 0}, 1.0}}, 1.0, {}});
  };
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    const Hysteresis h = PullUpAndDown(add, 2, integrator);
    EXPECT_TRUE(h.truncated);
    EXPECT_GT(h.released, 0.01);  // friction holds the joint bent
    EXPECT_LT(h.error, 1e-3);     // kMaxMissing of the length, at any time
  }
}

// The moment across the joint and the reaction cancel, so nothing is missing.
TEST(InteriorStops, DryFrictionThatHoldsAJointNeedsNoColumn) {
  MechanismDef chain = PulledChain(2);
  chain.frictions.push_back({"pin", {{FreedomRef{JointIndex(4), 0}, 1.0}}, 1.0, {}});
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    World world = testing::MustCreate(chain);
    MechanismDynamics& m = world.mechanisms()[0];
    ASSERT_TRUE(m.model().has_complement);
    StepOptions step = testing::Still();
    step.integrator = integrator;
    for (int i = 0; i < 30; ++i) {
      for (const int side : {1, -1})
        m.AddWrench(BodyIndex(side > 0 ? 5 : 4), Vector3::Zero(), Vector3(0, 0, 0.9 * side), Vector3::Zero());
      EXPECT_EQ(world.Step(step).refreshes, 0) << i;
    }
    EXPECT_LT(m.configuration().q.cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(InteriorStops, LargestActuatorForcesCount) {
  // Springs that weight bends little, and a motor on a joint in the middle.
  MechanismDef def = Tail(100, 0.05);
  ControlDef motor;
  motor.name = "m";
  motor.terms = {{FreedomRef{JointIndex(4), 0}, 1.0}};
  motor.gain = 1;
  motor.lower = -200;
  motor.upper = 200;
  def.controls.push_back(motor);
  EXPECT_FALSE(testing::MustCreate(def).mechanisms()[0].model().has_complement);
  def.controls[0].lower = def.controls[0].upper = 0.1;
  EXPECT_TRUE(testing::MustCreate(def).mechanisms()[0].model().has_complement);
}

}  // namespace
}  // namespace fork1s
