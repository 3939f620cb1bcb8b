// The step of second order: order, energy, momentum, and what a uniform motion must not change.
#include <cmath>
#include <dynamics/support.hpp>
#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/dynamics/theta_scheme.hpp>
#include <fork1s/linalg/solve.hpp>
#include <random_mechanism.hpp>

namespace fork1s {
namespace {

using testing::Momentum;
using testing::MustStart;
using testing::RandomMechanismOptions;
using testing::RandomSource;
using testing::Spin;
using testing::Still;

StepOptions Theta(double h, const Vector3& gravity = Vector3::Zero()) {
  StepOptions options = Still(h);
  options.gravity = gravity;
  options.integrator = Integrator::kTheta;
  return options;
}

// Where the bodies of a random mechanism are after half a second.
std::vector<Vector3> Places(const MechanismDef& definition, unsigned seed, StepOptions step) {
  RandomSource random(seed + 1000);
  const auto m = testing::Share(definition);
  const int n = m->num_coordinates();
  const VectorX q_dot = random.Vector(n, 1);
  const Vector6 V = definition.base == BaseKind::kFloating ? random.Six(1) : Vector6(Vector6::Zero());
  World::Options options;
  options.reduction.promote_hidden = true;
  options.reduction.modes = 100;  // nothing left out: the time step alone errs
  World world = MustStart(definition, VectorX::Zero(n), q_dot, V, options);
  MechanismDynamics& d = world.mechanisms()[0];
  const RigidTransform start = d.state().X_WR;
  const int steps = static_cast<int>(std::lround(0.5 / step.h));
  for (int i = 1; i <= steps; ++i) {
    const double t = i * step.h;
    if (definition.base == BaseKind::kDriven)
      d.DriveBase(start * RigidTransform(ExpRotation(Vector3(0, 0.3 * std::sin(3 * t), 0)),
                                         Vector3(0.1 * std::sin(4 * t), 0, 0)));
    EXPECT_TRUE(world.Step(step).finite);
  }
  std::vector<Vector3> places;
  for (int b = 0; b < m->num_bodies(); ++b) places.push_back(d.BodyPose(BodyIndex(b)).translation());
  return places;
}

double Farthest(const std::vector<Vector3>& a, const std::vector<Vector3>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, (a[i] - b[i]).norm());
  return most;
}

TEST(Theta, ErrorFallsWithTheSquareOfTheStep) {
  const Vector3 gravity(0, 0, -9.81);
  for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating, BaseKind::kDriven})
    for (const int loops : {0, 1})
      for (unsigned seed = 1; seed < 5; ++seed) {
        SCOPED_TRACE("base " + std::to_string(static_cast<int>(base)) + ", loops " + std::to_string(loops) +
                     ", seed " + std::to_string(seed));
        RandomMechanismOptions options;
        options.base = base;
        options.rigid_closures = options.springs = loops;
        const MechanismDef definition = testing::RandomMechanismDef(seed, options);
        // The truth is a run at a 32nd of the step, the same rule: a thousandth of the error that is judged.
        const auto truth = Places(definition, seed, Theta(1.0 / 60 / 32, gravity));
        StepOptions euler = Theta(1.0 / 60, gravity);
        euler.integrator = Integrator::kEuler;
        const double of_euler = Farthest(Places(definition, seed, euler), truth);
        double before = Farthest(Places(definition, seed, Theta(1.0 / 60, gravity)), truth);
        EXPECT_LT(before, 0.1 * of_euler);
        double all = 1;
        for (const int halves : {2, 4}) {
          const double now = Farthest(Places(definition, seed, Theta(1.0 / 60 / halves, gravity)), truth);
          EXPECT_LT(now, before) << halves;
          all *= before / now;
          before = now;
        }
        // Four a halving; modes between slow and fast change their rule with h.
        EXPECT_GT(std::sqrt(all), 3);
      }
}

// Two rods on soft springs that fall from level, through one reference after another, against fourth-order Runge
// and Kutta on their equations. Nothing is left at a reference that a shorter step would not take away.
TEST(Theta, ShorterStepsComeNearerThroughEveryReference) {
  constexpr double L = 0.3, c1 = 0.14, c2 = 0.11, m1 = 0.5, m2 = 0.3, I1 = 4e-3, I2 = 2e-3, k1 = 0.6, k2 = 0.25,
                   g = 9.81, T = 1;
  MechanismBuilder builder("rods");
  const auto add = [&](const char* name, BodyIndex parent, double at, double m, double c, double I, double k) {
    BodyDef rod;
    rod.name = name;
    rod.parent = parent;
    rod.X_PB = RigidTransform(Vector3(at, 0, 0));
    rod.inertia.mass = m;
    rod.inertia.center = Vector3(c, 0, 0);
    rod.inertia.rotational = I * Matrix3::Identity();
    const BodyIndex b = builder.AddBody(rod);
    builder.AddJoint(JointDef::Hinge(name, b, Vector3::UnitZ()).WithSpring(k));
    return b;
  };
  add("lower", add("upper", builder.base(), 0, m1, c1, I1, k1), L, m2, c2, I2, k2);
  builder.SetInterfaces({"lower"});

  // Angles from level, each from the world's x.
  const auto rates = [&](const Vector4& x) {
    Eigen::Matrix2d M;
    M << I1 + m1 * c1 * c1 + m2 * L * L, m2 * L * c2 * std::cos(x(0) - x(1)), 0, I2 + m2 * c2 * c2;
    M(1, 0) = M(0, 1);
    const double turn = m2 * L * c2 * std::sin(x(0) - x(1)), bend = k2 * (x(1) - x(0));
    const Vector2 f(-turn * x(3) * x(3) - (m1 * c1 + m2 * L) * g * std::cos(x(0)) - k1 * x(0) + bend,
                    turn * x(2) * x(2) - m2 * c2 * g * std::cos(x(1)) - bend);
    Vector4 rate;
    rate << x.tail<2>(), M.inverse() * f;
    return rate;
  };
  Vector4 x = Vector4::Zero();
  constexpr int kSteps = 10000;
  for (int i = 0; i < kSteps; ++i) {
    constexpr double s = T / kSteps;
    const Vector4 r1 = rates(x), r2 = rates(x + s / 2 * r1), r3 = rates(x + s / 2 * r2), r4 = rates(x + s * r3);
    x += s / 6 * (r1 + 2 * r2 + 2 * r3 + r4);
  }
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTheta}) {
    const bool second = integrator == Integrator::kTheta;
    SCOPED_TRACE(second ? "theta" : "euler");
    double before = 0;
    for (const int steps : {240, 960, 3840, 15360}) {
      int refreshes = 0;
      World world = MustStart(builder.definition(), VectorX::Zero(2), VectorX::Zero(2));
      StepOptions step = Theta(T / steps, Vector3(0, -g, 0));
      step.integrator = integrator;
      for (int i = 0; i < steps; ++i) refreshes += world.Step(step).refreshes;
      const VectorX& q = world.mechanisms()[0].configuration().q;
      const double error = std::hypot(q(0) - x(0), q(0) + q(1) - x(1));
      if (before > 0) {
        EXPECT_GT(before / error, second ? 14 : 3) << steps;  // 16 and 4
      }
      if (second) {
        EXPECT_GT(refreshes, 10);  // by Euler what has all its motions needs none
      }
      before = error;
    }
    EXPECT_LT(before, second ? 1e-6 : 3e-3);  // rad, of two
  }
}

TEST(Theta, SlowModeKeepsItsEnergy) {
  // 1 Hz at 1/60 s for 20 periods; the trapezoid loses none, θ - ½ = 3e-5 takes 1.3e-6 a step.
  const double I = 0.1, k = I * std::pow(2 * M_PI, 2), h = 1.0 / 60;
  MechanismBuilder builder("oscillator");
  BodyDef wheel;
  wheel.name = "wheel";
  wheel.parent = builder.base();
  wheel.inertia.mass = 1;
  wheel.inertia.rotational = I * Matrix3::Identity();
  const BodyIndex b = builder.AddBody(wheel);
  builder.AddJoint(JointDef::Hinge("axle", b, Vector3::UnitY()).WithSpring(k, 0));
  builder.SetInterfaces({"wheel"});
  World world = MustStart(builder.definition(), VectorX::Constant(1, 0.2), VectorX::Zero(1));
  const double start = world.PotentialEnergy(Vector3::Zero());
  for (int i = 0; i < 1200; ++i) world.Step(Theta(h));
  const double now = world.KineticEnergy() + world.PotentialEnergy(Vector3::Zero());
  EXPECT_LT(now, start * (1 + 1e-12));
  EXPECT_GT(now, 0.998 * start);
  // The trapezoid's phase: tan(ω' h / 2) = ω h / 2, 0.09 % slow.
  const double slow = 2 / h * std::atan(M_PI * h);
  EXPECT_NEAR(world.mechanisms()[0].configuration().q(0), 0.2 * std::cos(slow * 20), 2e-3);
}

TEST(Theta, StiffModeComesToRest) {
  // 1 kHz at 1/60 s, set off at 1 rad/s: as with implicit Euler nothing rings.
  MechanismBuilder builder("stiff");
  BodyDef wheel;
  wheel.name = "wheel";
  wheel.parent = builder.base();
  wheel.inertia.mass = 1;
  wheel.inertia.rotational = 0.1 * Matrix3::Identity();
  const BodyIndex b = builder.AddBody(wheel);
  builder.AddJoint(
      JointDef::Hinge("axle", b, Vector3::UnitY()).WithSpring(0.1 * std::pow(2 * M_PI * 1000, 2), 0));
  builder.SetInterfaces({"wheel"});
  World world = MustStart(builder.definition(), VectorX::Zero(1), VectorX::Ones(1));
  const double start = world.KineticEnergy();
  for (int i = 0; i < 6; ++i) world.Step(Theta(1.0 / 60));
  // Each step leaves 1e-4 of either energy or turns one into the other.
  EXPECT_LT(world.KineticEnergy() + world.PotentialEnergy(Vector3::Zero()), 1e-20 * start);
}

TEST(Theta, FlightKeepsMomentum) {
  for (const double stiffness : {0.2, 20.0}) {
    SCOPED_TRACE(stiffness);
    RandomSource random(4);
    const VectorX q_dot = random.Vector(8, 3);
    Vector6 V;
    V << 1, -2, 1.5, 0.3, 0.2, -0.1;
    World world = MustStart(testing::Walker(BaseKind::kFloating, stiffness, 0.01 * stiffness, true),
                            VectorX::Zero(8), q_dot, V);
    const MechanismDynamics& walker = world.mechanisms()[0];
    const Vector6 before = Momentum(walker);
    const Vector3 spin = Spin(walker);
    for (int i = 0; i < 480; ++i) {
      world.Step(Theta(1.0 / 240));
      ASSERT_LT((Momentum(walker) - before).tail<3>().norm(), 1e-11 * before.tail<3>().norm()) << i;
      ASSERT_LT((Spin(walker) - spin).norm(), 1e-4 * spin.norm()) << i;
    }
  }
}

TEST(Theta, DriftOfTheWholeChangesNothing) {
  // A walker that swings its legs, at rest and at 30 m/s; an arm on a base that stands and on one that moves
  // on.
  RandomSource random(5);
  const VectorX q_dot = random.Vector(8, 2);
  Vector6 V = random.Six(1), fast = V;
  fast.tail<3>() += Vector3(30, -20, 10);
  auto run = [&](const MechanismDef& m, const Vector6& twist, const Vector3& base_speed) {
    World world = MustStart(m, VectorX::Zero(8), q_dot, twist);
    MechanismDynamics& d = world.mechanisms()[0];
    const RigidTransform start = d.state().X_WR;
    for (int i = 1; i <= 120; ++i) {
      if (m.base == BaseKind::kDriven)
        d.DriveBase(RigidTransform(start.rotation(), start.translation() + i / 60.0 * base_speed));
      world.Step(Theta(1.0 / 60));
    }
    return VectorX(d.configuration().q);
  };
  const MechanismDef floating = testing::Walker(BaseKind::kFloating, 20, 0.2);
  // Sums of 30 m/s in place of 1, over 120 steps.
  EXPECT_LT((run(floating, V, Vector3::Zero()) - run(floating, fast, Vector3::Zero())).norm(), 1e-11);
  const MechanismDef driven = testing::Walker(BaseKind::kDriven, 20, 0.2);
  Vector6 moving = Vector6::Zero();
  moving.tail<3>() = driven.X_WR.rotation().transpose() * Vector3(0.3, 0, 0.1);
  EXPECT_LT(
      (run(driven, Vector6::Zero(), Vector3::Zero()) - run(driven, moving, Vector3(0.3, 0, 0.1))).norm(),
      1e-11);
}

TEST(Theta, TumblingBodyTurnsOver) {
  // Dzhanibekov's flip, no joints: spin and energy are those of the start.
  MechanismBuilder builder("rigid", BaseKind::kFloating, testing::Brick(1, Vector3(0.05, 0.1, 0.2)));
  builder.SetInterfaces({builder.definition().bodies[0].name});
  Vector6 V;
  V << 0.01, 6, 0.02, 0, 0, 0;
  World world = MustStart(builder.definition(), VectorX(), VectorX(), V);
  const MechanismDynamics& body = world.mechanisms()[0];
  const Vector3 spin = Spin(body);
  const double energy = body.KineticEnergy();
  double least = 1, most = -1;
  for (int i = 0; i < 240 * 5; ++i) {
    world.Step(Theta(1.0 / 240));
    const double along = (body.state().X_WR.rotation() * Vector3::UnitY()).dot(spin.normalized());
    least = std::min(least, along);
    most = std::max(most, along);
    ASSERT_LT((Spin(body) - spin).norm(), 1e-4 * spin.norm()) << i;
    ASSERT_LT(body.KineticEnergy(), energy * (1 + 1e-12)) << i;
  }
  EXPECT_LT(least, -0.95);
  EXPECT_GT(most, 0.95);
  EXPECT_GT(body.KineticEnergy(), energy * (1 - 1e-4));
}

// The rule of the header, step by step, at the reference: whatever dampers couple modes that a step can follow with modes
// that it cannot, and however heavy they are, no step gains energy. (With θ of each mode by its frequency alone one step
// gained a sixth of what there was.)
TEST(ThetaScheme, DampersTakeEnergyFromAnyMotion) {
  int runs = 0;
  for (unsigned k = 0; k < 80; ++k) {
    SCOPED_TRACE(k);
    const unsigned seed = k / 2;
    const bool symmetric = k % 2 == 1;
    RandomSource random(seed + 500);
    RandomMechanismOptions options;
    options.stiffness_low = 1e-1;
    options.stiffness_high = 1e5;
    const auto m = testing::Share(testing::RandomMechanismDef(seed, options));
    auto reduced = Reduce(m, VectorX::Zero(m->num_coordinates()));
    ASSERT_TRUE(reduced);
    ReducedModel model = std::move(*reduced);
    const int r = model.size();
    if (r < 2 || m->base() == BaseKind::kFloating) continue;
    // Few dampers, across all coordinates.
    MatrixX rows(2, r);
    for (int i = 0; i < 2; ++i) rows.row(i) = random.Vector(r, 1);
    const double h = 1.0 / 60, strength = std::pow(10.0, random.Uniform(-3, 3));
    model.D = strength * model.M.trace() / h * rows.transpose() * rows;
    ThetaScheme scheme;
    scheme.Fill(model, {{0, r}}, h, false, symmetric);
    if (symmetric) {
      EXPECT_LT((scheme.end - scheme.end.transpose()).norm(), 1e-13 * scheme.end.norm());
    }
    const MatrixX K = model.K_r.asDiagonal(), one = MatrixX::Identity(r, r);
    const MatrixX response =
        SolveSquare(model.M + scheme.end, one);
    VectorX z = random.Vector(r, 1), w = random.Vector(r, 1);
    const auto energy = [&] { return 0.5 * w.dot(model.M * w) + 0.5 * z.dot(K * z); };
    const double start = energy();
    double before = start, rise = 0;
    for (int i = 0; i < 500; ++i) {
      const VectorX w_end = response * (model.M * w - h * (K * z) - scheme.start * w);
      z += h * (w + scheme.Th * (w_end - w));
      w = w_end;
      rise = std::max(rise, energy() - before);
      before = energy();
    }
    ++runs;
    EXPECT_LT(rise, 1e-9 * start);  // rounding of springs and dampers up to 1e6 times heavier than others
  }
  EXPECT_GT(runs, 30);
}

}  // namespace
}  // namespace fork1s
