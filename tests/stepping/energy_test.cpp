// Energy never grows by itself.
#include <draws.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <random_mechanism.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::MustStart;
using testing::RandomMechanismOptions;
using testing::RandomSource;
using testing::Still;

struct Gain {
  // As shares of the energy at the start: of any later one, of a single step, of one that closed curved
  // loops.
  double above_start = 0, step = 0, refresh = 0;
};

// Over 300 steps without gravity or damping.
Gain LargestGain(unsigned seed, const RandomMechanismOptions& options, double scale, Integrator integrator,
                 Recovery recovery) {
  MechanismDef definition = testing::RandomMechanismDef(seed, options);
  definition = ScaleStiffness(definition, scale);
  RandomSource random(seed + 1000);
  const auto m = testing::Share(definition);
  const int n = m->num_coordinates();
  // Rates that the closures allow: those of the reduced coordinates are made of them.
  const VectorX q_dot = random.Vector(n, 1);
  Vector6 V = Vector6::Zero();
  if (definition.base == BaseKind::kFloating) V = random.Six(1);
  World::Options world_options;
  world_options.reduction.promote_hidden = true;
  world_options.recovery = recovery;
  world_options.reduction.modes = 100;
  World world = MustStart(definition, VectorX::Zero(n), q_dot, V, world_options);
  auto energy = [&] { return world.KineticEnergy() + world.PotentialEnergy(Vector3::Zero()); };
  const double start = energy();
  double before = start;
  Gain gain;
  StepOptions step = Still();
  step.integrator = integrator;
  for (int i = 0; i < 300; ++i) {
    const StepReport report = world.Step(step);
    EXPECT_TRUE(report.finite);
    EXPECT_TRUE(report.stages_converged);
    const double now = energy();
    gain.above_start = std::max(gain.above_start, (now - start) / start);
    double& largest = recovery == Recovery::kCurved && report.refreshes > 0 ? gain.refresh : gain.step;
    largest = std::max(largest, (now - before) / start);
    before = now;
  }
  return gain;
}

// A step's energies are differences of sums of a hundred terms.
constexpr double kRounding = 1e-9;
// In a single step: what it took of a motion before, it may give back, and joints too stiff for the step
// creep as the spin of the whole turns past them.
constexpr double kCreep = 5e-3;
// A refresh closes loops that were open by up to 0.2 mm, and springs take or give what that moves them.
constexpr double kClosing = 1e-3;

void ExpectNoGrowth(RandomMechanismOptions options, BaseKind base, Recovery recovery = Recovery::kExact) {
  options.base = base;
  options.damping_ratio = 0;
  const unsigned seeds = testing::Seeds(4, 12);
  for (unsigned seed = 0; seed < seeds; ++seed)
    for (const double scale : {1.0, 1e3, 1e6})
      for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
        SCOPED_TRACE("seed " + std::to_string(seed) + ", stiffness times " + std::to_string(scale) +
                     (integrator == Integrator::kEuler ? ", euler" : ", two stages"));
        const Gain gain = LargestGain(seed, options, scale, integrator, recovery);
        EXPECT_LT(gain.above_start, recovery == Recovery::kCurved ? kClosing : kRounding);
        EXPECT_LT(gain.step, kCreep);
        EXPECT_LT(gain.refresh, kCreep);
      }
}

TEST(Energy, FixedTreesNeverGain) { ExpectNoGrowth({}, BaseKind::kFixed); }

TEST(Energy, FloatingTreesNeverGain) { ExpectNoGrowth({}, BaseKind::kFloating); }

TEST(Energy, LoopsNeverGain) {
  RandomMechanismOptions options;
  options.rigid_closures = 1;
  options.springs = 1;
  ExpectNoGrowth(options, BaseKind::kFixed);
  ExpectNoGrowth(options, BaseKind::kFloating);
}

TEST(Energy, CurvedLoopsGainByClosingAlone) {
  RandomMechanismOptions options;
  options.rigid_closures = 1;
  options.springs = 1;
  ExpectNoGrowth(options, BaseKind::kFixed, Recovery::kCurved);
  ExpectNoGrowth(options, BaseKind::kFloating, Recovery::kCurved);
}

TEST(Energy, SlackSpringsNeverGain) {
  RandomMechanismOptions options;
  options.rigid_closures = 1;
  options.springs = 4;
  options.slack = 0.2;
  ExpectNoGrowth(options, BaseKind::kFixed);
  ExpectNoGrowth(options, BaseKind::kFloating);
}

TEST(Energy, UnsprungJointsNeverGain) {
  RandomMechanismOptions options;
  options.unsprung = 0.3;
  // Rotation vectors that a spring holds in one component may come to a full turn, where they have no rates.
  options.hinges_only = true;
  ExpectNoGrowth(options, BaseKind::kFixed);
  ExpectNoGrowth(options, BaseKind::kFloating);
}

TEST(Energy, StiffWalkerComesToRest) {
  // Falls on its feet, springs times a million: what it has goes into the ground.
  const MechanismDef definition = testing::WalkerOnFeet(0.3, 2e7, 2e4);
  Scene scene;
  scene.mechanisms.push_back(definition);
  scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
  World::Options options;
  options.collision.margin = 0.1;
  World world = testing::MustCreate(scene, options);
  StepOptions step;
  double before = world.KineticEnergy() + world.PotentialEnergy(step.gravity);
  for (int i = 0; i < 300; ++i) {
    const StepReport report = world.Step(step);
    ASSERT_TRUE(report.finite);
    const double now = world.KineticEnergy() + world.PotentialEnergy(step.gravity);
    // Pushing penetration out lifts 3.2 kg by a share of a tenth of a millimetre.
    ASSERT_LT(now - before, 1e-3) << i;
    before = now;
  }
  EXPECT_LT(world.KineticEnergy(), 1e-6);
  EXPECT_NEAR(world.mechanisms()[0].state().X_WR.translation().z(), 0.02, 1e-3);
}

// A damper takes q̇ᵀ D q̇, wherever loops have turned the coordinates that the reduced model has of it.
TEST(Energy, DampersOfLoopsTakeWhatTheyDoAtThePose) {
  testing::FourBar bars;
  MechanismDef definition = bars.Definition();
  for (JointDef& joint : definition.joints)
    for (FreedomDef& f : joint.freedoms) {
      f.stiffness *= 1e-3;  // slow, so that the pose leaves the reference far behind
      f.damping = joint.name == "A" ? 0 : 1e-3;
    }
  const auto m = testing::Share(definition);
  World world = testing::MustStart(definition, VectorX::Zero(3), VectorX::Constant(3, 3.0), Vector6::Zero());
  StepOptions step;
  step.gravity.setZero();
  step.refresh = false;
  step.h = 1e-5;
  const MechanismDynamics& d = world.mechanisms()[0];
  const auto energy = [&] { return d.KineticEnergy() + d.PotentialEnergy(Vector3::Zero()); };
  while (d.ComputeLinearizationDrift().share < 1.5) world.Step(step);  // 22 degrees
  constexpr int kSteps = 100;
  const double before = energy();
  double taken = 0;
  for (int i = 0; i < kSteps; ++i) {
    const VectorX rate = d.configuration().Q_now * d.state().w;
    taken += step.h * rate.dot(m->damping().cwiseProduct(rate));
    world.Step(step);
  }
  // Of first order in h: a step turns a joint by 3e-5 rad. By dampers of the reference it is off by 1.8 %.
  EXPECT_NEAR(before - energy(), taken, 2e-3 * taken);
  EXPECT_GT(taken, 1e-3 * before);
}

// Of a servo k (q - u)²/2, whatever was asked before: of another set-point at the same pose, of another pose.
TEST(Energy, OfAServoIsThatOfItsSetPointNow) {
  constexpr double kStiffness = 3;
  MechanismBuilder builder("arm");
  BodyDef rod;
  rod.name = "rod";
  rod.parent = builder.base();
  rod.inertia = testing::Rod(1, 0.5);
  const BodyIndex b = builder.AddBody(rod);
  const JointIndex joint =
      builder.AddJoint(JointDef::Hinge("elbow", b, Vector3::UnitY()).WithSpring(kStiffness, 0.1));
  ControlDef servo;
  servo.name = "servo";
  servo.terms.emplace_back(FreedomRef{joint, 0}, 1.0);
  servo.gain = kStiffness;
  servo.is_setpoint = true;
  builder.AddControl(servo);
  builder.SetInterfaces({"rod"});
  World world = testing::MustCreate(builder.definition());
  MechanismDynamics& m = world.mechanisms()[0];
  for (const double set_point : {0.3, -0.2, 0.5}) {
    m.controls()(0) = set_point;
    for (int step = 0; step < 3; ++step) {
      const double q = m.configuration().q(0);
      EXPECT_NEAR(m.PotentialEnergy(Vector3::Zero()), 0.5 * kStiffness * (q - set_point) * (q - set_point),
                  1e-14);
      world.Step(Still());
    }
    EXPECT_NE(m.configuration().q(0), 0);
  }
}

}  // namespace
}  // namespace fork1s
