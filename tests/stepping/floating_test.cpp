// Mechanisms in free flight, and on a base that is driven.
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <random_mechanism.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::Momentum;
using testing::MustStart;
using testing::RandomSource;
using testing::Spin;
using testing::Still;

// The ball of one body and no joint, as a mechanism with a floating base.
Scene BallAsMechanism(double height) {
  MechanismBuilder builder("ball", BaseKind::kFloating, testing::Ball(0.5, 0.1));
  MechanismDef ball = builder.definition();
  ball.bodies[0].name = "ball";
  ball.bodies[0].geometries.push_back(testing::Geometry("skin", Sphere{0.1}, 0.8));
  ball.interfaces = {"ball"};
  ball.X_WR = RigidTransform(Vector3(0, 0, height));
  Scene scene;
  scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
  scene.mechanisms.push_back(ball);
  return scene;
}

class BallAsMechanismTest : public ::testing::TestWithParam<Integrator> {};

// At the end it turns by 0.46 rad in a step.
TEST_P(BallAsMechanismTest, RollsDownASlopeLikeAFreeBody) {
  const double theta = 0.2;
  World world = testing::MustCreate(BallAsMechanism(0.1));
  StepOptions options;
  options.integrator = GetParam();
  options.gravity = 9.81 * Vector3(std::sin(theta), 0, -std::cos(theta));
  for (int i = 0; i < 120; ++i) world.Step(options);
  const MechanismDynamics& ball = world.mechanisms()[0];
  const double expected = 5.0 / 7 * 9.81 * std::sin(theta) * 2;
  const Vector6 V = ball.BodyVelocity(BodyIndex(0));
  // The solver's residual is 1e-4 or better of the step's impulse.
  EXPECT_NEAR(V(3), expected, 1e-3 * expected);
  EXPECT_NEAR(V(1) * 0.1, expected, 1e-3 * expected);
  EXPECT_NEAR(ball.state().X_WR.translation().z(), 0.1, 2e-4);  // slop
}

INSTANTIATE_TEST_SUITE_P(Integrators, BallAsMechanismTest,
                         ::testing::Values(Integrator::kEuler, Integrator::kTwoStage));

TEST(Floating, LandsWithoutSinking) {
  World world = testing::MustCreate(BallAsMechanism(0.6));
  for (int i = 0; i < 90; ++i) {
    world.Step(StepOptions());
    // Within the slop of a tenth of a millimetre, from 3.1 m/s.
    ASSERT_GT(world.mechanisms()[0].state().X_WR.translation().z(), 0.1 - 1.1e-4) << i;
  }
}

TEST(Floating, FlightConservesMomentum) {
  for (const double stiffness : {0.2, 20.0, 2000.0})
    for (const bool feet : {true, false}) {
      SCOPED_TRACE(stiffness);
      RandomSource random(4);
      const VectorX q_dot = random.Vector(8, 3);
      Vector6 V;
      V << 1, -2, 1.5, 0.3, 0.2, -0.1;
      World world = MustStart(testing::Walker(BaseKind::kFloating, stiffness, 0.01 * stiffness, feet),
                              VectorX::Zero(8), q_dot, V);
      const MechanismDynamics& walker = world.mechanisms()[0];
      const Vector6 before = Momentum(walker);
      const Vector3 spin = Spin(walker);
      for (int i = 0; i < 120; ++i) {
        ASSERT_TRUE(world.Step(Still()).finite);
        if (i % 10 == 5) {
          ASSERT_TRUE(world.mechanisms()[0].Refresh());
        }
        const Vector6 now = Momentum(walker);
        ASSERT_LT((now - before).tail<3>().norm(), 1e-10 * before.tail<3>().norm()) << i;
        // Of second order in the turn of a step, 0.05 rad.
        ASSERT_LT((Spin(walker) - spin).norm(), 1e-2 * spin.norm()) << i;
        // The centre's path is first order in h, so that momentum about the origin keeps a small part of P.
        ASSERT_LT((now - before).head<3>().norm(), 0.01 * before.head<3>().norm()) << i;
      }
    }
}

TEST(Floating, GravityOnlyMovesTheCenter) {
  World world = MustStart(testing::Walker(BaseKind::kFloating, 20, 0.2), VectorX::Zero(8), VectorX::Zero(8));
  StepOptions options;
  const int n = 600;  // to 98 m/s
  for (int i = 0; i < n; ++i) world.Step(options);
  const MechanismDynamics& walker = world.mechanisms()[0];
  // Forces of gravity cancel against the fall's inertia to rounding, of 98 m/s in each of 600 steps, and no
  // velocity feeds it.
  EXPECT_LT(walker.configuration().q.cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT(LogRotation(walker.state().X_WR.rotation()).norm(), 1e-9);
  EXPECT_NEAR(walker.state().X_WR.translation().z(), -9.81 * n * n / 7200.0, 9.81 * n / 7200.0 + 1e-9);
}

TEST(Floating, RigidBodyTumblesLikeAFreeOne) {
  // A base without joints against the same inertia as a free body, spinning about its middle axis.
  FreeBodyDef def = testing::BoxBody("box", 1, Vector3(0.05, 0.1, 0.2), Vector3(5, 0, 0), 1);
  def.geometries.clear();
  MechanismBuilder builder("rigid", BaseKind::kFloating, def.inertia);
  builder.SetInterfaces({builder.definition().bodies[0].name});
  Scene scene;
  scene.mechanisms.push_back(builder.definition());
  scene.free_bodies.push_back(def);
  KeyframeDef key;
  Vector6 V;
  V << 0.1, 6, 0.2, 0, 0, 0;
  key.mechanisms.push_back({VectorX(), VectorX(), RigidTransform(), V, {}});
  key.free_bodies.push_back({RigidTransform(Vector3(5, 0, 0)), V.head<3>(), Vector3::Zero()});
  scene.keyframes.push_back(key);
  World::Options options;
  options.initial_keyframe = 0;
  World world = testing::MustCreate(scene, options);
  const double energy = world.mechanisms()[0].KineticEnergy();
  for (int i = 0; i < 60; ++i) world.Step(Still(1.0 / 240));
  const Matrix3 turn =
      world.mechanisms()[0].state().X_WR.rotation().transpose() * world.free_bodies()[0].pose().rotation();
  // Two second-order rules, 0.25 s at 6 rad/s in steps of 0.025 rad.
  EXPECT_LT(LogRotation(turn).norm(), 5e-3);
  EXPECT_NEAR(world.mechanisms()[0].KineticEnergy(), energy, 1e-3 * energy);
}

// A mass on a spring along x, on a base driven along x.
MechanismDef Slider(BaseKind base, double mass, double k, double d) {
  MechanismBuilder builder("slider", base, testing::Ball(1, 0.1));
  BodyDef cart;
  cart.name = "cart";
  cart.parent = builder.base();
  cart.inertia = testing::Ball(mass, 0.1);
  const BodyIndex b = builder.AddBody(cart);
  builder.AddJoint(JointDef::Slide("rail", b, Vector3::UnitX()).WithSpring(k, d));
  builder.SetInterfaces({"cart"});
  return builder.definition();
}

// By two stages the same falls with the square of the step, to the motion that fourth-order Runge and Kutta
// find.
TEST(Driven, BaseShakesASpringToSecondOrder) {
  const double m = 2, k = 50, d = 1, T = 2;
  const auto base = [](double t) { return 0.05 * (1 - std::cos(3 * t)); };
  const auto rate = [&](double t, double x, double v) {
    return -(k * x + d * v) / m - 0.45 * std::cos(3 * t);
  };
  double x = 0, v = 0;
  const double s = 1e-3;
  for (int i = 0; i < 2000; ++i) {
    const double t = i * s;
    const double a1 = rate(t, x, v), a2 = rate(t + s / 2, x + s / 2 * v, v + s / 2 * a1),
                 a3 = rate(t + s / 2, x + s / 2 * v + s * s / 4 * a1, v + s / 2 * a2),
                 a4 = rate(t + s, x + s * v + s * s / 2 * a2, v + s * a3);
    x += s * v + s * s / 6 * (a1 + a2 + a3);
    v += s / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  double before = 0;
  for (const int steps : {120, 240, 480}) {
    World world = testing::MustCreate(Slider(BaseKind::kDriven, m, k, d));
    StepOptions step = Still(T / steps);
    step.integrator = Integrator::kTwoStage;
    for (int i = 1; i <= steps; ++i) {
      world.mechanisms()[0].DriveBase(RigidTransform(Vector3(base(T * i / steps), 0, 0)));
      world.Step(step);
    }
    const double error = std::abs(world.mechanisms()[0].configuration().q(0) - x);
    EXPECT_LT(error, 4e-4 * std::pow(120.0 / steps, 2));  // 1 % of the swing at 1/60 s
    if (before > 0) {
      EXPECT_NEAR(before / error, 4, 0.5);
    }
    before = error;
  }
}

TEST(Driven, BaseShakesASpring) {
  const double m = 2, k = 50, d = 1, h = 1.0 / 60;
  World world = testing::MustCreate(Slider(BaseKind::kDriven, m, k, d));
  MechanismDynamics& slider = world.mechanisms()[0];
  double x = 0, v = 0, V_base = 0;
  for (int i = 0; i < 300; ++i) {
    const double to = 0.05 * std::sin(3 * (i + 1) * h);
    slider.DriveBase(RigidTransform(Vector3(to, 0, 0)));
    world.Step(testing::BackwardEuler(h));
    // Relative to the base: m (v⁺ - v) = -h (k x⁺ + d v⁺) - m ΔV, V the rate of its path at the end.
    const double V_next = slider.state().V_R(3);
    v = (m * v - h * k * x - m * (V_next - V_base)) / (m + h * d + h * h * k);
    x += h * v;
    V_base = V_next;
    ASSERT_NEAR(slider.configuration().q(0), x, 1e-11) << i;
    ASSERT_NEAR(slider.BodyPose(BodyIndex(1)).translation().x(), to + x, 1e-11);
    ASSERT_NEAR(slider.BodyVelocity(BodyIndex(1))(3), V_next + v, 1e-10);
  }
}

// A finger that its servo moves, on a base that stands and on one that moves on at 0.3 m/s: neither servo nor
// damper may feel how fast the whole goes.
TEST(Driven, BaseThatMovesOnChangesNothing) {
  MechanismBuilder builder("finger", BaseKind::kDriven, testing::Ball(0.3, 0.05));
  BodyDef lower;
  lower.name = "lower";
  lower.parent = builder.base();
  lower.inertia = testing::Rod(0.08, 0.1);
  const BodyIndex l = builder.AddBody(lower);
  BodyDef tip;
  tip.name = "tip";
  tip.parent = l;
  tip.X_PB = RigidTransform(Vector3(0.1, 0, 0));
  tip.inertia = testing::Rod(0.05, 0.08);
  const BodyIndex t = builder.AddBody(tip);
  const JointIndex knuckle =
      builder.AddJoint(JointDef::Hinge("knuckle", l, Vector3::UnitY()).WithSpring(3, 0.01));
  builder.AddJoint(JointDef::Hinge("middle", t, Vector3::UnitY()).WithSpring(0.5, 0.01));
  ControlDef servo;
  servo.name = "servo";
  servo.terms.emplace_back(FreedomRef{knuckle, 0}, 1.0);
  servo.gain = 3;
  servo.is_setpoint = true;
  builder.AddControl(servo);
  builder.SetInterfaces({"tip"});
  const MechanismDef finger = builder.definition();
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    const auto run = [&](const Vector3& speed) {
      Vector6 V = Vector6::Zero();
      V.tail<3>() = speed;
      World world = MustStart(finger, VectorX::Zero(2), VectorX::Zero(2), V);
      MechanismDynamics& d = world.mechanisms()[0];
      StepOptions step = Still(1.0 / 240);
      step.integrator = integrator;
      for (int i = 1; i <= 480; ++i) {
        d.controls()(0) = std::min(1.2, 0.004 * i);  // past many references
        d.DriveBase(RigidTransform(i * step.h * speed));
        EXPECT_TRUE(world.Step(step).finite);
      }
      return VectorX(d.configuration().q);
    };
    const VectorX still = run(Vector3::Zero());
    EXPECT_NEAR(still(0), 1.2, 0.01);
    // Rounding of poses half a metre away, differences of which are rates.
    EXPECT_LT((run(Vector3(0.3, 0, 0.1)) - still).norm(), 1e-11) << static_cast<int>(integrator);
  }
}

// Panels on soft hinges on a hub that tumbles for a minute: by two stages its spin stays what it was but for
// a share that short steps take away. (Implicit Euler, which lets the panels swing themselves out, changes it
// by half a per cent.)
TEST(Floating, PanelsOnATumblingHubKeepTheirSpin) {
  MechanismBuilder builder("satellite", BaseKind::kFloating, testing::Brick(2, Vector3(0.06, 0.04, 0.05)));
  const auto panel = [&](const char* name, double side, double mass, const Vector3& axis) {
    BodyDef body;
    body.name = name;
    body.parent = builder.base();
    body.X_PB = RigidTransform(ExpRotation(Vector3(0, 0, side > 0 ? 0 : M_PI)), Vector3(0.06 * side, 0, 0));
    body.inertia = testing::Brick(mass, Vector3(0.15, 0.1, 0.005));
    body.inertia.center = Vector3(0.15, 0, 0);
    builder.AddJoint(JointDef::Hinge(name, builder.AddBody(body), axis).WithSpring(0.4));
  };
  panel("left", -1, 0.2, Vector3::UnitY());
  panel("right", 1, 0.3, Vector3::UnitZ());
  builder.SetInterfaces({"left", "right"});
  Vector6 V;
  V << 1, 3, 2, 0.3, 0.1, 0;
  // Of third order in what a step turns; 0.05 rad at 1/60 s.
  for (const auto& [a_second, most] : {std::pair(60, 5e-3), std::pair(240, 1.5e-4)}) {
    World world = MustStart(builder.definition(), Vector2(0.3, -0.2), Vector2(0.5, -1), V);
    const MechanismDynamics& satellite = world.mechanisms()[0];
    const auto energy = [&] { return world.KineticEnergy() + world.PotentialEnergy(Vector3::Zero()); };
    const Vector3 spin = Spin(satellite);
    const double start = energy();
    StepOptions step = Still(1.0 / a_second);
    step.integrator = Integrator::kTwoStage;
    for (int i = 0; i < 60 * a_second; ++i) {
      ASSERT_TRUE(world.Step(step).finite);
      ASSERT_LT((Spin(satellite) - spin).norm(), most * spin.norm()) << i << " of " << a_second;
      // Two stages are not algebraically stable: within a swing energy goes up and down by a term of third
      // order, 7e-5 of it at 1/60 s, 1e-6 at 1/240 s. It must not add up.
      ASSERT_LT(energy(), start * (1 + 1e-5)) << i;
    }
    EXPECT_GT(energy(), start * (1 - 4 * most));  // what it lost of swinging: 1 % and a hundredth of that
  }
}

TEST(Fixed, OscillatorFollowsImplicitEuler) {
  const double I = 0.1, k = 4, d = 0.02, h = 1.0 / 60;
  MechanismBuilder builder("oscillator");
  BodyDef wheel;
  wheel.name = "wheel";
  wheel.parent = builder.base();
  wheel.inertia.mass = 1;
  wheel.inertia.rotational = I * Matrix3::Identity();
  const BodyIndex b = builder.AddBody(wheel);
  builder.AddJoint(JointDef::Hinge("axle", b, Vector3::UnitY()).WithSpring(k, d));
  builder.SetInterfaces({"wheel"});
  World world = MustStart(builder.definition(), VectorX::Constant(1, 0.6), VectorX::Constant(1, -1.0));
  double q = 0.6, v = -1;
  for (int i = 0; i < 300; ++i) {
    world.Step(testing::BackwardEuler(h));
    v = (I * v - h * k * q) / (I + h * d + h * h * k);
    q += h * v;
    ASSERT_NEAR(world.mechanisms()[0].configuration().q(0), q, 1e-12) << i;
  }
  EXPECT_GT(std::abs(v), 1e-3);  // still swinging, so that something was compared
}

}  // namespace
}  // namespace fork1s
