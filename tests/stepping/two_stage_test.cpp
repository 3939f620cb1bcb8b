// The two-stage implicit step: order, stiff springs that turn, momentum, contact, and what it reports.
#include <cmath>
#include <limits>
#include <random_mechanism.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::MustCreate;
using testing::MustStart;
using testing::RandomMechanismOptions;
using testing::RandomSource;

StepOptions By(Integrator integrator, double h, const Vector3& gravity = Vector3(0, 0, -9.81)) {
  StepOptions options = testing::Still(h);
  options.gravity = gravity;
  options.integrator = integrator;
  return options;
}

// Positions of the bodies of a random mechanism after half a second.
std::vector<Vector3> Positions(const MechanismDef& definition, unsigned seed, const StepOptions& step) {
  RandomSource random(seed + 1000);
  const auto m = testing::Share(definition);
  const int n = m->num_coordinates();
  const VectorX q_dot = random.Vector(n, 1);
  const Vector6 V = definition.base == BaseKind::kFloating ? random.Six(1) : Vector6(Vector6::Zero());
  World::Options options;
  options.reduction.promote_hidden = true;
  options.reduction.modes = 100;  // nothing truncated: only the time step errs
  World world = MustStart(definition, VectorX::Zero(n), q_dot, V, options);
  MechanismDynamics& d = world.mechanisms()[0];
  const RigidTransform start = d.state().X_WR;
  const int steps = static_cast<int>(std::lround(0.5 / step.h));
  for (int i = 1; i <= steps; ++i) {
    const double t = i * step.h;
    if (definition.base == BaseKind::kDriven)
      d.DriveBase(start * RigidTransform(ExpRotation(Vector3(0, 0.15 * (1 - std::cos(3 * t)), 0)),
                                         Vector3(0.1 * (1 - std::cos(4 * t)), 0, 0)));
    const StepReport report = world.Step(step);
    EXPECT_TRUE(report.finite);
    EXPECT_TRUE(report.stages_converged);
  }
  std::vector<Vector3> positions;
  for (int b = 0; b < m->num_bodies(); ++b) positions.push_back(d.BodyPose(BodyIndex(b)).translation());
  return positions;
}

double LargestDistance(const std::vector<Vector3>& a, const std::vector<Vector3>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, (a[i] - b[i]).norm());
  return largest;
}

// The truth is the other second-order scheme at a 32nd of the step, which shares neither formula nor residual. A
// refresh within stiff dampers leaves 1e-4 m in either on a fixed base; there the runs must come together to that.
TEST(TwoStage, ErrorFallsWithTheSquareOfTheStep) {
  double log_ratio = 0;  // of floating bases
  for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating, BaseKind::kDriven})
    for (const int loops : {0, 1})
      for (unsigned seed = 1; seed < 4; ++seed) {
        SCOPED_TRACE("base " + std::to_string(static_cast<int>(base)) + ", loops " + std::to_string(loops) +
                     ", seed " + std::to_string(seed));
        RandomMechanismOptions options;
        options.base = base;
        options.rigid_closures = options.springs = loops;
        const MechanismDef definition = testing::RandomMechanismDef(seed, options);
        const auto truth = Positions(definition, seed, By(Integrator::kTwoStage, 1.0 / 60 / 32));
        const double coarse =
            LargestDistance(Positions(definition, seed, By(Integrator::kTwoStage, 1.0 / 60)), truth);
        const double fine =
            LargestDistance(Positions(definition, seed, By(Integrator::kTwoStage, 1.0 / 240)), truth);
        if (base == BaseKind::kFixed) {
          EXPECT_LT(fine, 3e-4);
          continue;
        }
        // 16 by theory; modes that 1/60 s cannot follow leave less.
        EXPECT_GT(coarse / fine, 4) << coarse << " " << fine;
        if (base == BaseKind::kFloating) log_ratio += std::log(coarse / fine) / 6;
      }
  EXPECT_GT(std::exp(log_ratio), 12);  // geometric mean: a slope of 1.8
}

// A bob of 0.5 kg on a spring of 0.5 m between two points, that swings from `amplitude` [rad]; the spring is
// stretched by the weight at the start.
MechanismDef Bob(double stiffness, double amplitude) {
  constexpr double kLength = 0.5, kMass = 0.5;
  const double length = kLength + kMass * 9.81 * std::cos(amplitude) / stiffness;
  MechanismDef def = testing::BobOnPath(kMass, length, amplitude, "spring");
  def.springs.push_back(
      {"spring", {}, stiffness, 0, kLength - length, {0, 1}});  // rest counts from the length at q = 0
  return def;
}

// Largest distance from vertical in the tenth second, of that in the first.
double SwingLeft(double stiffness, double amplitude) {
  World world = MustCreate(Bob(stiffness, amplitude));
  double first = 0, last = 0;
  for (int i = 0; i < 600; ++i) {
    const StepReport report = world.Step(By(Integrator::kTwoStage, 1.0 / 60));
    EXPECT_TRUE(report.finite && report.stages_converged);
    const double x = std::abs(world.mechanisms()[0].BodyPose(BodyIndex(1)).translation().x());
    if (i < 120) first = std::max(first, x);
    if (i >= 480) last = std::max(last, x);
  }
  return last / first;
}

TEST(TwoStage, ABobOnAStiffSpringKeepsItsSwing) {
  // One linear solve a step at the pose of the start left 1 % of the energy at 2e4 N/m, nothing at 1e6.
  for (const double stiffness : {2e3, 2e4, 1e6, 1e8}) EXPECT_GT(SwingLeft(stiffness, 0.1), 0.98) << stiffness;
  // At 0.8 rad the scheme itself loses order where h² k/m is large (docs/decisions/001-time-stepping.md).
  for (const double stiffness : {2e3, 2e4}) EXPECT_GT(SwingLeft(stiffness, 0.8), 0.95) << stiffness;
}

TEST(TwoStage, MomentumOfAFloatingMechanismIsConstant) {
  for (unsigned seed = 1; seed < 4; ++seed) {
    RandomMechanismOptions options;
    options.base = BaseKind::kFloating;
    const MechanismDef definition = testing::RandomMechanismDef(seed, options);
    RandomSource random(seed);
    const int n = testing::Share(definition)->num_coordinates();
    World::Options world_options;
    world_options.reduction.promote_hidden = true;
    World world = MustStart(definition, VectorX::Zero(n), random.Vector(n, 1), random.Six(1), world_options);
    const MechanismDynamics& m = world.mechanisms()[0];
    const Vector6 before = testing::Momentum(m);
    const StepOptions step = By(Integrator::kTwoStage, 1.0 / 60, Vector3::Zero());
    for (int i = 0; i < 120; ++i) world.Step(step);
    const Vector6 after = testing::Momentum(m);
    // Linear to rounding; angular to the tolerance of the stages, 1e-4 of their motion squared.
    EXPECT_LT((after - before).tail<3>().norm(), 1e-10 * before.tail<3>().norm()) << seed;
    EXPECT_LT((after - before).head<3>().norm(), 1e-3 * before.norm()) << seed;
  }
}

// A rotor that turns freely about a vertical hinge, with a bob on an arm that a spring lets flap.
MechanismDef RotorWithAFlappingArm() {
  MechanismBuilder builder("rotor");
  BodyDef hub;
  hub.name = "hub";
  hub.parent = builder.base();
  hub.inertia = testing::Ball(1, 0.1);
  const BodyIndex h = builder.AddBody(hub);
  BodyDef bob;
  bob.name = "bob";
  bob.parent = h;
  bob.X_PB = RigidTransform(Vector3(0.3, 0, 0));
  bob.inertia = testing::Ball(0.5, 0.03);
  const BodyIndex b = builder.AddBody(bob);
  builder.AddJoint(JointDef::Hinge("turn", h, Vector3::UnitZ()));
  builder.AddJoint(JointDef::Hinge("flap", b, Vector3::UnitY(), Vector3(-0.25, 0, 0)).WithSpring(20));
  builder.SetInterfaces({"hub", "bob"});
  return builder.definition();
}

// Nothing acts about the hinge. What a stage leaves of its equation adds up over the steps: in the velocity a
// share kChangeTolerance of all that it changes by, here less than 20 times itself in a second, whatever the
// step.
TEST(TwoStage, FineStepsLeaveNoMoreOfASpinThanCoarse) {
  for (const Integrator integrator : {Integrator::kTwoStage, Integrator::kEuler})
    for (const double h : {1.0 / 240, 1.0 / 4000}) {
      World world = MustStart(RotorWithAFlappingArm(), Vector2(0, 0.5), Vector2(20, 0));
      const MechanismDynamics& m = world.mechanisms()[0];
      const double before = testing::Momentum(m)(2);
      for (int i = 0; i < std::lround(1 / h); ++i) world.Step(By(integrator, h, Vector3::Zero()));
      EXPECT_NEAR(testing::Momentum(m)(2) / before, 1, 2e-4) << h;
    }
}

// A light tree on soft springs and ball joints that hangs on a heavier body, and floats without damping.
MechanismDef FloatingSoftTree(unsigned seed) {
  RandomSource random(seed);
  const auto inertia = [&](double mass, double radius) {
    SpatialInertia out = testing::Ball(mass, radius);
    out.center = 0.04 * random.Direction();
    return out;
  };
  MechanismBuilder builder("tree", BaseKind::kFloating, inertia(1, 0.08));
  BodyIndex parent = builder.base();
  std::vector<std::string> interfaces;
  for (int i = 0; i < 7; ++i) {
    BodyDef body;
    body.name = "b" + std::to_string(i);
    body.parent = i == 3 ? BodyIndex(2) : parent;
    body.X_PB = RigidTransform(ExpRotation(Vector3(random.InBox(2))), 0.14 * random.Direction());
    body.inertia = inertia(0.15, 0.09);
    parent = builder.AddBody(body);
    const double stiffness = 0.1 * std::pow(50, random.Uniform(0, 1));
    if (i % 3 == 2)
      builder.AddJoint(JointDef::Ball("j" + std::to_string(i), parent).WithSpring(stiffness));
    else
      builder.AddJoint(
          JointDef::Hinge("j" + std::to_string(i), parent, random.Direction()).WithSpring(stiffness));
    interfaces.push_back(body.name);
  }
  builder.SetInterfaces(interfaces);
  return builder.definition();
}

// Over 20 s in free fall the energy of the last second is at most that of the first. Stages that were solved
// to a share of a motion that had the fall in it let it grow to four times as much.
TEST(TwoStage, FloatingUndamped_EnergyHasNoTrend) {
  for (unsigned seed = 1; seed < 9; ++seed) {
    const MechanismDef definition = FloatingSoftTree(seed);
    RandomSource random(seed);
    const int n = testing::Share(definition)->num_coordinates();
    World world = MustStart(definition, VectorX::Zero(n), random.Vector(n, 1.5), random.Six(0.5));
    const StepOptions step = By(Integrator::kTwoStage, 1.0 / 240);
    const auto most = [&](int steps) {
      double energy = -std::numeric_limits<double>::infinity();
      for (int i = 0; i < steps; ++i) {
        EXPECT_TRUE(world.Step(step).stages_converged);
        energy = std::max(energy, world.KineticEnergy() + world.PotentialEnergy(step.gravity));
      }
      return energy;
    };
    const double first = most(240);
    most(18 * 240);
    EXPECT_LT(most(240), first + 1e-6 * std::abs(first)) << seed;
  }
}

TEST(TwoStage, ASlidingBallThatSpinsAboutTheVerticalStaysOnItsLine) {
  Scene scene;
  scene.world.push_back(testing::Geometry("floor", Plane{}, 0.3));
  scene.free_bodies.push_back(testing::BallBody("ball", 1, 0.1, Vector3(0, 0, 0.1), 0.3));
  World world = MustCreate(scene);
  world.free_bodies()[0].SetState(RigidTransform(Vector3(0, 0, 0.1)), Vector3(0, 0, 20), Vector3(2, 0, 0));
  for (int i = 0; i < 36; ++i) EXPECT_TRUE(world.Step(By(Integrator::kTwoStage, 1.0 / 60)).finite);
  const Vector3 p = world.free_bodies()[0].pose().translation();
  EXPECT_GT(p.x(), 0.5);
  EXPECT_LT(std::abs(p.y()), 1e-4);
}

// Wherever in the step a ball meets the floor, all of its speed stays there: nothing is extrapolated back, also where the
// shortest part, of implicit Euler, only closes the gap and the one after it stops what is left.
TEST(TwoStage, ALandingIsNotThrownBack) {
  const double h = 1.0 / 60;
  int impacts = 0;
  for (int k = 0; k < 40; ++k) {
    SCOPED_TRACE(k);
    Scene scene;
    scene.world.push_back(testing::Geometry("floor", Plane{}, 0.3));
    scene.free_bodies.push_back(testing::BallBody("ball", 1, 0.1, Vector3(0, 0, 0.1 + 0.013 * (k + 1)), 0.3));
    World world = MustCreate(scene);
    for (int i = 0; i < 60; ++i) {
      const double before = world.free_bodies()[0].velocity_of_center().z();
      const StepReport report = world.Step(By(Integrator::kTwoStage, h));
      ASSERT_TRUE(report.finite);
      EXPECT_EQ(report.impact, report.parts > 1);
      EXPECT_LE(report.parts, 8);
      impacts += report.impact ? 1 : 0;
      // What contact gives in a step is what the momentum changes by beside the weight, through an impact too.
      double impulse = 0;
      for (const ContactRecord& c : world.contacts()) impulse += c.impulse(0);
      EXPECT_NEAR(impulse, world.free_bodies()[0].velocity_of_center().z() - before + 9.81 * h, 1e-9);
      EXPECT_LT(world.free_bodies()[0].velocity_of_center().z(),
                2e-3);  // what is pressed in comes back; 0.16 is what gravity gives in a step
    }
    EXPECT_NEAR(world.free_bodies()[0].pose().translation().z(), 0.1, 1e-5);
  }
  EXPECT_GE(impacts, 40);
  EXPECT_LE(impacts, 50);  // some fall between two steps, and what is left of the speed is met in the second
}

// A servo whose set point moves and a base that is driven, beside a ball that lands: the steps that are halved ask the
// parts for the inputs of their own times. The arm then moves as it does alone, but for what shorter steps are nearer to
// the truth.
TEST(TwoStage, InputsGoOnThroughAnImpact) {
  const double h = 1.0 / 60;
  MechanismDef arm = testing::Chain(1, 0.25, 1, 20, 0.5);
  arm.base = BaseKind::kDriven;
  ControlDef servo;
  servo.name = "servo";
  servo.terms.emplace_back(FreedomRef{JointIndex(0), 0}, 1.0);
  servo.gain = 20;
  servo.is_setpoint = true;
  arm.controls.push_back(servo);
  const auto set_point = [](double t) { return VectorX(VectorX::Constant(1, std::sin(9 * t))); };
  const auto base = [](double t) {
    return RigidTransform(ExpRotation(Vector3(0, 0, 0.4 * std::sin(7 * t))),
                          Vector3(5 + 0.1 * std::sin(8 * t), 0, 2));
  };
  arm.X_WR = base(0);
  const auto run = [&](bool with_ball, double step_h, int& impacts) {
    Scene scene;
    scene.mechanisms.push_back(arm);
    if (with_ball) {
      scene.world.push_back(testing::Geometry("floor", Plane{}, 0.3));
      scene.free_bodies.push_back(testing::BallBody("ball", 1, 0.1, Vector3(0, 0, 0.4), 0.3));
    }
    World world = MustCreate(scene);
    MechanismDynamics& m = world.mechanisms()[0];
    const int parts = static_cast<int>(std::lround(h / step_h));
    std::vector<double> q;
    for (int i = 0; i < 40 * parts; ++i) {
      const double t = i * step_h;
      m.controls() = set_point(t + step_h);
      m.MoveControls();
      m.DriveBase(base(t + step_h));
      const StepReport report = world.Step(By(Integrator::kTwoStage, step_h));
      EXPECT_TRUE(report.finite);
      impacts += report.impact ? 1 : 0;
      if ((i + 1) % parts == 0) q.push_back(m.configuration().q(0));
    }
    return q;
  };
  int impacts = 0, none = 0;
  const auto beside = run(true, h, impacts), alone = run(false, h, none), truth = run(false, h / 16, none);
  EXPECT_GE(impacts, 1);
  EXPECT_EQ(none, 0);
  double apart = 0, error = 0;
  for (std::size_t i = 0; i < alone.size(); ++i) {
    apart = std::max(apart, std::abs(beside[i] - alone[i]));
    error = std::max(error, std::abs(alone[i] - truth[i]));
  }
  EXPECT_LT(apart, error / 8);  // 1/18; by inputs of the whole step in either half 0.7 of it
}

TEST(TwoStage, ReportsIterationsAndResidual) {
  World world = MustCreate(Bob(1e6, 0.8));
  int most = 0;
  for (int i = 0; i < 60; ++i) {
    const StepReport report = world.Step(By(Integrator::kTwoStage, 1.0 / 60));
    EXPECT_GE(report.stage_iterations, 2);
    EXPECT_LT(report.stage_residual, 1e-4 * 0.05 + 1e-8);  // of the 0.05 m that a step moves at most
    most = std::max(most, report.stage_iterations);
  }
  EXPECT_GT(most, 2);  // this spring turns too far within a stage for one linear solve
}

// A walker that lands and stands: through impacts, lasting contact and refreshes.
TEST(TwoStage, ARestoredStateGivesTheSameBits) {
  const MechanismDef walker = testing::WalkerOnFeet(0.04);
  Scene scene;
  scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
  scene.mechanisms.push_back(walker);
  scene.free_bodies.push_back(testing::BallBody("ball", 0.1, 0.05, Vector3(1, 1, 0.05), 0.8));
  World world = MustCreate(scene), other = MustCreate(scene);
  const StepOptions step = By(Integrator::kTwoStage, 1.0 / 60);
  int contacts = 0;
  for (int i = 0; i < 40; ++i) contacts += world.Step(step).contacts;
  EXPECT_GT(contacts, 40);
  WorldState saved, end, again;
  world.Save(saved);
  for (int i = 0; i < 40; ++i) world.Step(step);
  world.Save(end);
  other.Restore(saved);
  for (int i = 0; i < 40; ++i) other.Step(step);
  other.Save(again);
  EXPECT_EQ(HashOf(end), HashOf(again));
}

}  // namespace
}  // namespace fork1s
