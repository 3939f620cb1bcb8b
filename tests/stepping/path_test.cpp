// Springs, dampers, stops, friction and motors on a thread through space that moves far: against closed
// forms.
#include <cmath>
#include <numbers>

#include "support.hpp"

namespace fork1s {
namespace {

// A rod that turns about z at the origin; a thread from (kPost, 0, 0) in the world to the rod at kHook. With
// θ the rod's angle from x the thread's length is ℓ(θ), ℓ² = kPost² + kHook² - 2 kPost kHook cos θ. The rod's
// reference is at kStart.
constexpr double kPost = 0.3, kHook = 0.2, kStart = 0.6;

double Thread(double theta) {
  return std::sqrt(kPost * kPost + kHook * kHook - 2 * kPost * kHook * std::cos(theta));
}
double ThreadArm(double theta) { return kPost * kHook * std::sin(theta) / Thread(theta); }

PathElementDef At(BodyIndex body, const Vector3& p_B) {
  PathElementDef e;
  e.body = body;
  e.X_BE = RigidTransform(p_B);
  return e;
}

MechanismDef Threaded(double joint_stiffness = 0) {
  MechanismBuilder builder("threaded");
  BodyDef rod;
  rod.name = "rod";
  rod.parent = builder.base();
  rod.X_PB = RigidTransform(ExpRotation(Vector3(0, 0, kStart)), Vector3::Zero());
  rod.inertia = testing::Rod(1, 0.5);
  const BodyIndex b = builder.AddBody(rod);
  builder.AddJoint(JointDef::Hinge("hinge", b, Vector3::UnitZ()).WithSpring(joint_stiffness));
  builder.SetInterfaces({"rod"});
  MechanismDef def = builder.definition();
  def.paths.push_back({"thread", {At(builder.base(), Vector3(kPost, 0, 0)), At(b, Vector3(kHook, 0, 0))}});
  return def;
}

// The rod's moment of inertia about its end.
double RodInertia(const MechanismDef& def) {
  const SpatialInertia& I = def.bodies[1].inertia;
  return I.Matrix()(2, 2);
}

TEST(Paths, TorqueFarFromTheReferenceIsTheClosedForm) {
  MechanismDef def = Threaded();
  SpringDef spring{"thread", {}, 400, 3, 0.02, {0, 2}};
  def.springs.push_back(spring);
  ControlDef motor;
  motor.name = "motor";
  motor.gain = 5;
  motor.along = {0, -1};
  def.controls.push_back(motor);
  const auto m = testing::Share(def);
  Kinematics k(*m);
  for (const double q : {0.0, 1e-3, 0.9, 2.0, -2.8}) {
    const VectorX at = VectorX::Constant(1, q);
    ComputeKinematics(*m, at, k);
    const double theta = kStart + q, arm = 2 * ThreadArm(theta);
    const double force = 400 * (0.02 - 2 * (Thread(theta) - Thread(kStart)));
    VectorX tau;
    SpringForce(*m, k, at, tau);
    EXPECT_NEAR(tau(0), arm * force, 1e-12 * 400)
        << q;  // rounding of a length of a metre times the stiffness
    EXPECT_NEAR(StiffnessMatrix(*m, k, at)(0, 0), 400 * arm * arm, 1e-12 * 400);
    EXPECT_NEAR(DampingMatrix(*m, k, at)(0, 0), 3 * arm * arm, 1e-12);
    EXPECT_NEAR(SpringEnergy(*m, k, at), force * force / (2 * 400), 1e-12);
    tau.setZero();
    AddControlForce(*m, k, VectorX::Constant(1, 0.7), tau);
    EXPECT_NEAR(tau(0), -0.7 * 5 * ThreadArm(theta), 1e-13);
  }
}

// θ after `time` from rest at `theta`, by Runge-Kutta of fourth order on I θ'' = -k (ℓ - ℓ*) ℓ'.
double SwungTo(double inertia, double stiffness, double length, double theta, double time) {
  const auto accelerate = [&](double at) {
    return -stiffness * (Thread(at) - length) * ThreadArm(at) / inertia;
  };
  const int steps = 20000;
  const double h = time / steps;
  double rate = 0;
  for (int i = 0; i < steps; ++i) {
    const double a1 = accelerate(theta), v2 = rate + h / 2 * a1, a2 = accelerate(theta + h / 2 * rate),
                 v3 = rate + h / 2 * a2, a3 = accelerate(theta + h / 2 * v2), v4 = rate + h * a3,
                 a4 = accelerate(theta + h * v3);
    theta += h / 6 * (rate + 2 * v2 + 2 * v3 + v4);
    rate += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  return theta;
}

// Swings through 2 rad, past several refreshes. Errors fall with the step, by its first and second power.
TEST(Paths, ASwingThroughTwoRadiansFollowsTheClosedForm) {
  MechanismDef def = Threaded();
  constexpr double kStiffness = 60, kTime = 0.8;
  const double length = Thread(2.2);
  def.springs.push_back({"thread", {}, kStiffness, 0, length - Thread(kStart), {0, 1}});
  const double truth = SwungTo(RodInertia(def), kStiffness, length, kStart, kTime);
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    double error[2];
    for (int halved = 0; halved < 2; ++halved) {
      World world = testing::MustCreate(def);
      StepOptions step = testing::Still(halved ? 1e-3 : 2e-3);
      step.integrator = integrator;
      double farthest = 0;
      for (double t = 0; t < kTime - step.h / 2; t += step.h) {
        ASSERT_TRUE(world.Step(step).finite);
        farthest = std::max(farthest, world.mechanisms()[0].configuration().q(0));
      }
      EXPECT_GT(farthest, 1.9);
      error[halved] = std::abs(kStart + world.mechanisms()[0].configuration().q(0) - truth);
    }
    const double order = std::log2(error[0] / error[1]);
    EXPECT_NEAR(order, integrator == Integrator::kEuler ? 1 : 2, 0.25) << error[0] << " " << error[1];
    EXPECT_LT(error[1], integrator == Integrator::kEuler ? 0.02 : 2e-4);
  }
}

// A spring a hundred thousand times stiffer than the inertia at this step, whose arm doubles on the way: it
// must come to rest on its length and not swing up.
TEST(Paths, AStiffThreadComesToRestOnItsLength) {
  MechanismDef def = Threaded();
  const double rest = 1.7;
  def.springs.push_back({"thread", {}, 1e6, 1e3, Thread(rest) - Thread(kStart), {0, 1}});
  World world = testing::MustCreate(def);
  for (int i = 0; i < 600; ++i) ASSERT_TRUE(world.Step(testing::Still()).finite);
  EXPECT_NEAR(kStart + world.mechanisms()[0].configuration().q(0), rest, 1e-6);
}

// A motor of constant pull against the spring of the joint: u ℓ'(θ) = k (θ - θ₀), far from the reference.
TEST(Paths, AMotorHoldsItsSpringWhereTheArmsOfThePoseSay) {
  MechanismDef def = Threaded(0.8);
  def.joints[0].freedoms[0].damping = 0.3;
  ControlDef motor;
  motor.name = "motor";
  motor.gain = 1;
  motor.along = {0, 1};
  def.controls.push_back(motor);
  World world = testing::MustCreate(def);
  constexpr double kPull = 6;
  world.mechanisms()[0].controls()(0) = kPull;
  for (int i = 0; i < 1200; ++i) ASSERT_TRUE(world.Step(testing::Still()).finite);
  double theta = kStart;  // the arm is even in its changes here: bisection between none and all
  for (double low = kStart, high = std::numbers::pi, i = 0; i < 60; ++i) {
    theta = (low + high) / 2;
    (kPull * ThreadArm(theta) > 0.8 * (theta - kStart) ? low : high) = theta;
  }
  EXPECT_GT(theta, kStart + 1);
  EXPECT_NEAR(kStart + world.mechanisms()[0].configuration().q(0), theta, 1e-9);
}

// A rope that may not be longer: a motor swings the rod out until it is taut, and the stop bears what is
// over.
TEST(Paths, ARopeStopsTheRodWhereItIsTaut) {
  MechanismDef def = Threaded();
  def.joints[0].freedoms[0].damping = 0.3;
  LengthLimitDef rope;
  rope.name = "rope";
  const double taut = 2.0;
  rope.upper = Thread(taut) - Thread(kStart);
  rope.along = {0, 1};
  def.length_limits.push_back(rope);
  ControlDef motor{"motor", {{FreedomRef{JointIndex(0), 0}, 1.0}}, 1};
  def.controls.push_back(motor);
  World world = testing::MustCreate(def);
  world.mechanisms()[0].controls()(0) = 2;
  StepReport report;
  for (int i = 0; i < 600; ++i) report = world.Step(testing::Still());
  EXPECT_EQ(report.limits, 1);
  EXPECT_NEAR(kStart + world.mechanisms()[0].configuration().q(0), taut, 1e-4);  // the stop gives by 10 µm
  VectorX tau = VectorX::Zero(1);
  world.AddStopForces(0, 1.0 / 60, tau);
  EXPECT_NEAR(tau(0), -2, 1e-6);
}

// Dry friction along the thread holds up to F ℓ'(θ) and no more.
TEST(Paths, DryFrictionHoldsByTheArmOfThePose) {
  for (const double share : {0.99, 1.01}) {
    MechanismDef def = Threaded();
    DryFrictionDef friction{"thread", {}, 4, {0, 1}};
    def.frictions.push_back(friction);
    ControlDef motor{"motor", {{FreedomRef{JointIndex(0), 0}, 1.0}}, 1};
    def.controls.push_back(motor);
    const double q = 1.1;
    World world = testing::MustStart(def, VectorX::Constant(1, q), VectorX::Zero(1));
    world.mechanisms()[0].controls()(0) = share * 4 * ThreadArm(kStart + q);
    for (int i = 0; i < 60; ++i) ASSERT_TRUE(world.Step(testing::Still()).finite);
    const double moved = std::abs(world.mechanisms()[0].configuration().q(0) - q);
    if (share < 1) {
      EXPECT_LT(moved, 1e-6);
    } else {
      EXPECT_GT(moved, 1e-2);
    }
  }
}

// A servo on the thread that can give no more pulls with its bound, by the arm of the pose.
TEST(Paths, AServoOnAThreadGivesItsBound) {
  MechanismDef def = Threaded(0.8);
  def.joints[0].freedoms[0].damping = 0.3;
  def.springs.push_back({"servo", {}, 1e4, 10, 0, {0, 1}});
  ControlDef servo;
  servo.name = "servo";
  servo.gain = 1e4;
  servo.is_setpoint = true;
  servo.along = {0, 1};
  def.controls.push_back(servo);
  ForceLimitDef limit;
  limit.name = "servo";
  limit.inputs = {{"servo", 1.0}};
  limit.stiffness = 1e4;
  limit.damping = 10;
  limit.lower = -6;
  limit.upper = 6;
  limit.along = {0, 1};
  def.force_limits.push_back(limit);
  World world = testing::MustCreate(def);
  world.mechanisms()[0].controls()(0) = 0.4;  // longer than it will be
  StepReport report;
  for (int i = 0; i < 1200; ++i) report = world.Step(testing::Still());
  EXPECT_EQ(report.forces_at_bound, 1);
  const double theta = kStart + world.mechanisms()[0].configuration().q(0);
  EXPECT_GT(theta, kStart + 1);
  // The last micronewtons move energies by less than their rounding, and then nothing moves.
  EXPECT_NEAR(6 * ThreadArm(theta), 0.8 * (theta - kStart), 1e-6);
}

TEST(Paths, RefusesWhatIsNoPath) {
  const auto refused = [](auto change) {
    MechanismDef def = Threaded();
    change(def);
    const auto built = BuildMechanism(def);
    return built ? std::string("was built") : built.error().Text();
  };
  using Kind = PathElementDef::Kind;
  const auto contains = [](const std::string& text, const char* part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  contains(refused([](auto& d) { d.paths[0].elements[1].body = BodyIndex(7); }),
           "path 'thread', element 2: is on a body that does not exist");
  contains(refused([](auto& d) { d.paths[0].elements[1].kind = Kind::kSphere; }), "between two points");
  contains(refused([](auto& d) { d.paths[0].elements.pop_back(); }), "only point of its branch");
  contains(refused([](auto& d) {
             d.paths[0].elements[1].kind = Kind::kPulley;
             d.paths[0].elements[1].divisor = 0;
           }),
           "only point");
  contains(refused([](auto& d) {
             d.springs.push_back({"s", {}, 1, 0, 0, {1, 1}});
           }),
           "path that does not exist");
}

// A force that turns with its rod does work as one from outside: and the balance of energy leaves it alone.
TEST(Paths, AForceThatTurnsWithItsBodyDrivesIt) {
  MechanismDef def = Threaded();
  PathDef jet;
  jet.name = "jet";
  jet.kind = PathKind::kWrench;
  jet.elements = {At(BodyIndex(1), Vector3(0.4, 0.1, 0))};
  jet.gear << 0, 0, 0.05, 0.3, 2, 0.7;
  def.paths = {jet};
  ControlDef motor;
  motor.name = "motor";
  motor.gain = 0.5;
  motor.initial = 3;
  motor.along = {0, 1};
  MechanismDef by_joint = def;
  def.controls.push_back(motor);
  const double moment = 1.5 * (0.05 + 0.4 * 2 - 0.1 * 0.3), rate = moment * 2 / RodInertia(def);
  motor.along = {};
  motor.terms = {{{JointIndex(0), 0}, moment / 1.5}};
  by_joint.paths.clear();
  by_joint.controls.push_back(motor);
  for (const Integrator by : {Integrator::kEuler, Integrator::kTwoStage}) {
    World world = testing::MustCreate(def), peer = testing::MustCreate(by_joint);
    StepOptions step = testing::Still();
    step.integrator = by;
    for (int i = 0; i < 120; ++i) {
      ASSERT_TRUE(world.Step(step).finite);
      ASSERT_TRUE(peer.Step(step).finite);
    }
    EXPECT_GT(world.mechanisms()[0].configuration().q(0), 10);  // rad: more than once round
    const double energy = 0.5 * RodInertia(def) * rate * rate;
    // As a motor on the joint; either is late where a step turns by 0.4 rad.
    EXPECT_NEAR(world.KineticEnergy(), peer.KineticEnergy(), 1e-12 * energy);
    EXPECT_NEAR(world.KineticEnergy(), energy, 0.03 * energy);
    EXPECT_EQ(world.PotentialEnergy(step.gravity), 0);  // it stores nothing
  }
}

}  // namespace
}  // namespace fork1s
