// Mechanisms in contact: stiff gains, mass ratios, one mechanism against another.
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::Geometry;
using testing::MustCreate;

// A finger of 1e-5 kg m² about y along x, held at a set-point; a ball of 5 mm at its tip, 0.1 m out.
MechanismDef Finger(const std::string& name, double kp, double kv, double side, const RigidTransform& X_WR) {
  MechanismBuilder builder(name);
  BodyDef link;
  link.name = name + "_link";
  link.parent = builder.base();
  link.inertia.mass = 0.004;
  link.inertia.center = Vector3(0.05, 0, 0);
  link.inertia.rotational = Vector3(1e-8, 1e-8, 1e-8).asDiagonal();  // 0.004 * 0.05² = 1e-5 about the hinge
  link.geometries.push_back(Geometry(name + "_tip", Sphere{0.005}, 0.8, RigidTransform(Vector3(0.1, 0, 0))));
  const BodyIndex b = builder.AddBody(link);
  const JointIndex j =
      builder.AddJoint(JointDef::Hinge(name + "_joint", b, side * Vector3::UnitY()).WithSpring(kp, kv));
  ControlDef control;
  control.name = name;
  control.terms.emplace_back(FreedomRef{j, 0}, 1.0);
  control.gain = kp;
  control.is_setpoint = true;
  builder.AddControl(control);
  builder.SetInterfaces({link.name});
  MechanismDef definition = builder.definition();
  definition.bodies[0].name = name + "_base";
  definition.X_WR = X_WR;
  return definition;
}

// An explicit spring at h = 5 ms would need kp < 9.33 N·m/rad.
constexpr double kGain = 9.33e4;

TEST(StiffContact, GainAgainstThePlane) {
  Scene scene;
  scene.world.push_back(Geometry("floor", Plane{}, 0.8));
  scene.mechanisms.push_back(Finger("finger", kGain, 0, 1, RigidTransform(Vector3(0, 0, 0.01))));
  World world = MustCreate(scene);
  MechanismDynamics& finger = world.mechanisms()[0];
  StepOptions step;
  step.h = 0.005;
  for (int i = 0; i < 600; ++i) {
    // Pressed 0.01 rad into the plane, let go, and pressed again.
    finger.controls()(0) = i / 100 % 2 ? 0.0 : 0.06;
    const StepReport report = world.Step(step);
    ASSERT_TRUE(report.finite);
    ASSERT_LT(std::abs(finger.configuration().q(0)), 0.1) << i;
    if (i % 100 == 99 && i / 100 % 2 == 0) {
      EXPECT_EQ(report.contacts, 1);
      // At rest against the plane: kp (u - q) balances the contact force, friction included, about the hinge.
      const ContactRecord& contact = world.contacts()[0];
      const Vector3 force = contact.point.frame.transpose() * contact.impulse / step.h;
      const Vector3 arm = contact.point.point - Vector3(0, 0, 0.01);
      const double torque = kGain * (0.06 - finger.configuration().q(0));
      EXPECT_NEAR(std::abs(arm.cross(force).y()), torque, 0.01 * torque);
    }
  }
  EXPECT_LT(std::abs(finger.configuration().q(0)), 1e-3);
}

TEST(StiffContact, GainAgainstABody) {
  Scene scene;
  scene.world.push_back(Geometry("floor", Plane{}, 0.8));
  scene.mechanisms.push_back(Finger("finger", kGain, 0, 1, RigidTransform(Vector3(0, 0, 0.045))));
  scene.free_bodies.push_back(testing::BallBody("ball", 0.05, 0.02, Vector3(0.1, 0, 0.02), 0.8));
  World world = MustCreate(scene);
  MechanismDynamics& finger = world.mechanisms()[0];
  StepOptions step;
  step.h = 0.005;
  finger.controls()(0) = 0.02;  // presses the ball between tip and floor
  for (int i = 0; i < 400; ++i) {
    ASSERT_TRUE(world.Step(step).finite);
    ASSERT_LT(std::abs(finger.configuration().q(0)), 0.2) << i;
    ASSERT_LT(world.free_bodies()[0].velocity_of_center().norm(), 5) << i;
    ASSERT_GT(world.free_bodies()[0].pose().translation().z(), 0.01) << i;
  }
}

TEST(StiffContact, ChainOfMassRatioAMillion) {
  MechanismDef definition = testing::Chain(4, 0.1, 1e-3, 100, 1);
  definition.bodies[4].inertia = testing::Rod(1e3, 0.1);
  World world = MustCreate(definition);
  StepOptions step;
  step.h = 0.1;
  step.gravity = Vector3(0, -9.81, 0);
  double before = world.KineticEnergy() + world.PotentialEnergy(step.gravity);
  const double start = before;
  for (int i = 0; i < 300; ++i) {
    ASSERT_TRUE(world.Step(step).finite) << i;
    const double now = world.KineticEnergy() + world.PotentialEnergy(step.gravity);
    // A tonne that hangs on springs falls half a metre: 4 kJ; nothing may come on top of it.
    ASSERT_LT(now - start, 1.0) << i;
    before = now;
  }
  EXPECT_LT(world.mechanisms()[0].BodyPose(BodyIndex(5)).translation().norm(), 0.4 + 1e-9);
}

TEST(Mechanisms, TwoFingersPressEachOther) {
  // Mirror images above and below z = 0, whose tips overlap by 2 mm each where their set-points are.
  Scene scene;
  const double k = 2, reach = 0.1;
  scene.mechanisms.push_back(Finger("upper", k, 0.05, 1, RigidTransform(Vector3(0, 0, 0.006))));
  scene.mechanisms.push_back(Finger("lower", k, 0.05, -1, RigidTransform(Vector3(0, 0, -0.006))));
  World world = MustCreate(scene);
  StepOptions step = testing::Still();
  const double u = 0.03;
  for (MechanismDynamics& m : world.mechanisms()) m.controls()(0) = u;
  StepReport report;
  for (int i = 0; i < 600; ++i) report = world.Step(step);
  ASSERT_EQ(report.contacts, 1);
  const double q0 = world.mechanisms()[0].configuration().q(0),
               q1 = world.mechanisms()[1].configuration().q(0);
  EXPECT_NEAR(q0, q1, 1e-6);
  // The tips meet halfway: 0.006 m less the tip's 0.005 m below the hinge.
  EXPECT_NEAR(q0, std::asin(0.001 / reach), 1e-3);
  const ContactRecord& contact = world.contacts()[0];
  EXPECT_NEAR(std::abs(contact.point.frame(0, 2)), 1, 1e-6);
  // k (u - q) about the hinge is the force's moment.
  EXPECT_NEAR(contact.impulse(0) / step.h * contact.point.point.x(), k * (u - q0), 1e-3 * k * (u - q0));
}

TEST(Mechanisms, ABallBetweenTwoFingersIsHeld) {
  Scene scene;
  scene.mechanisms.push_back(Finger("upper", 2, 0.05, 1, RigidTransform(Vector3(0, 0, 0.026))));
  scene.mechanisms.push_back(Finger("lower", 2, 0.05, -1, RigidTransform(Vector3(0, 0, -0.026))));
  scene.free_bodies.push_back(testing::BallBody("ball", 0.05, 0.02, Vector3(0.1, 0, 0), 1));
  World world = MustCreate(scene);
  for (MechanismDynamics& m : world.mechanisms()) m.controls()(0) = 0.1;
  StepOptions step;
  // Gravity across the grip: friction carries the ball, 2 * 2 N at least against 0.5 N.
  step.gravity = Vector3(0, -9.81, 0);
  for (int i = 0; i < 120; ++i) ASSERT_TRUE(world.Step(step).finite);
  const Vector3 there = world.free_bodies()[0].pose().translation();
  EXPECT_EQ(world.contacts().size(), 2u);
  double friction = 0;
  for (const ContactRecord& c : world.contacts()) {
    const double sign = world.collision_bodies()[static_cast<std::size_t>(c.point.body_b)].kind ==
                                CollisionBody::Kind::kFreeBody
                            ? 1
                            : -1;
    friction += sign * (c.point.frame.transpose() * c.impulse).y() / step.h;
  }
  EXPECT_NEAR(friction, 0.05 * 9.81, 1e-3 * 0.05 * 9.81);
  for (int i = 0; i < 60; ++i) world.Step(step);
  EXPECT_LT((world.free_bodies()[0].pose().translation() - there).norm(), 1e-4);
}

// A cylinder looks ahead as far as a step carries it: rolling at 5 m/s it moves by 83 mm a step, nearly three
// times the height of the step of the road.
TEST(Contact, ATyreRollsOverAStepOfTheRoad) {
  constexpr double kRadius = 0.3, kHeight = 0.03, kSpeed = 5;
  Scene scene;
  scene.world.push_back(testing::Geometry("road", Plane{}, 0.9));
  scene.world.push_back(testing::Geometry("step", Box{Vector3(1, 1, kHeight / 2)}, 0.9,
                                          RigidTransform(Vector3(2.5, 0, kHeight / 2))));
  FreeBodyDef wheel;
  wheel.name = "wheel";
  wheel.X_WB.translation().z() = kRadius;
  const double m = 10, w = 0.1;
  wheel.inertia.mass = m;
  wheel.inertia.rotational.diagonal() << m * (3 * kRadius * kRadius + 4 * w * w) / 12,
      m * kRadius * kRadius / 2, m * (3 * kRadius * kRadius + 4 * w * w) / 12;
  wheel.geometries.push_back(
      testing::Geometry("tyre", Cylinder{kRadius, w}, 0.9,
                        RigidTransform(ExpRotation(Vector3(M_PI / 2, 0, 0)), Vector3::Zero())));
  scene.free_bodies.push_back(wheel);
  KeyframeDef rolling;
  rolling.free_bodies.push_back({wheel.X_WB, Vector3(0, kSpeed / kRadius, 0), Vector3(kSpeed, 0, 0)});
  scene.keyframes.push_back(rolling);
  World::Options options;
  options.initial_keyframe = 0;
  World world = testing::MustCreate(scene, options);
  double deepest = 0, highest = 0;
  const double first = world.KineticEnergy();
  for (int i = 0; i < 60; ++i) {
    const StepReport report = world.Step(StepOptions{});
    deepest = std::max(deepest, report.max_penetration);
    highest = std::max(highest, world.free_bodies()[0].pose().translation().z());
  }
  EXPECT_LT(deepest, 2e-4);                     // twice the slop
  EXPECT_GT(highest, kRadius + 0.9 * kHeight);  // over it, and not through
  EXPECT_GT(world.free_bodies()[0].pose().translation().x(), 4);
  // Meeting the edge at 26 degrees below the axle, a rigid wheel loses what it had along it: about a sixth.
  EXPECT_LT(world.KineticEnergy(), first);
  EXPECT_GT(world.KineticEnergy(), 0.5 * first);
}

}  // namespace
}  // namespace fork1s
