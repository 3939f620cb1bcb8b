// What the interior's own displacement does under loads that stiffen it.
#include <fork1s/mechanism/builder.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::MustStart;
using testing::Still;

constexpr int kLinks = 6;
constexpr double kLink = 0.1;  // m

// A rope of light links on soft springs, of which nothing but its heavy end is seen, and a heavy slider that swings
// beside it and has a million times its energy.
MechanismDef RopeBesideSlider() {
  MechanismBuilder builder("rope");
  BodyDef slider;
  slider.name = "slider";
  slider.parent = builder.base();
  slider.X_PB = RigidTransform(Vector3(0, 2, 0));
  slider.inertia = testing::Brick(1000, Vector3::Constant(0.2));
  builder.AddJoint(JointDef::Slide("rail", builder.AddBody(slider), Vector3::UnitX()).WithSpring(400, 0));
  BodyIndex parent = builder.base();
  for (int i = 0; i < kLinks; ++i) {
    BodyDef link;
    link.name = "link" + std::to_string(i);
    link.parent = parent;
    link.X_PB = RigidTransform(Vector3(i == 0 ? 0 : kLink, 0, 0));
    link.inertia = testing::Rod(i + 1 == kLinks ? 5 : 0.01, kLink);
    parent = builder.AddBody(link);
    builder.AddJoint(
        JointDef::Hinge("hinge" + std::to_string(i), parent, Vector3::UnitZ()).WithSpring(0.5, 2));
  }
  builder.SetInterfaces({"slider", "link5"});
  return builder.definition();
}

// rad that a joint of the rope moves in the last of 1200 steps under this weight and this pull at its end.
double MoveOfRopeAtRest(const Vector3& gravity, const Vector3& pull) {
  VectorX q_dot = VectorX::Zero(1 + kLinks);
  q_dot(0) = 1;
  World::Options options;
  options.reduction.modes = 0;
  World world = MustStart(RopeBesideSlider(), VectorX::Zero(1 + kLinks), q_dot, Vector6::Zero(), options);
  MechanismDynamics& m = world.mechanisms()[0];
  EXPECT_TRUE(m.model().has_complement);
  StepOptions step = Still();
  step.gravity = gravity;
  const BodyIndex end = m.mechanism().FindBody("link5");
  VectorX before, last;
  for (int i = 0; i < 1200; ++i) {
    if (!pull.isZero(0)) m.AddWrench(end, pull, Vector3::Zero(), m.BodyPose(end) * Vector3(kLink, 0, 0));
    EXPECT_TRUE(world.Step(step).finite);
    before = last;
    last = m.configuration().q.tail(kLinks);
  }
  EXPECT_GT(m.KineticEnergy() + m.PotentialEnergy(Vector3::Zero()), 100);  // of the slider's 500 J
  return (last - before).cwiseAbs().maxCoeff();
}

constexpr double kSettles = 1e-4;  // rad a step: slow motion that is left after 20 s

// The rope's end bears a load that makes the rope ten times as stiff as its springs do. Whole steps of Newton with
// those alone would overshoot, each by more than the one before, up to where the slider's energy no longer hides it.
TEST(Interior, StandsStillInARopeUnderTensionWhileSomethingHeavySwings) {
  EXPECT_LT(MoveOfRopeAtRest(Vector3::Zero(), Vector3(40, 4, 0)), kSettles);
  EXPECT_LT(MoveOfRopeAtRest(Vector3(8, 0.8, 0), Vector3::Zero()), kSettles);
}

// A chain of which only the last link is seen, on a base that is driven.
MechanismDef ChainOnDrivenBase() {
  MechanismDef chain = testing::Chain(10, 0.05, 0.05, 18, 0.01);
  chain.base = BaseKind::kDriven;
  chain.bodies[5].inertia = testing::Rod(0.5, 0.05);  // heavy in the middle, where nothing sees it
  return chain;
}

// m that the tip is farthest from where the base is, across the chain, while the base follows a path for 0.6 s.
double FarthestTip(Integrator integrator, int modes, double h, double (*path)(double)) {
  World::Options options;
  options.reduction.modes = modes;
  World world = testing::MustCreate(ChainOnDrivenBase(), options);
  MechanismDynamics& m = world.mechanisms()[0];
  EXPECT_EQ(m.model().has_complement, modes == 0);
  const BodyIndex tip = m.mechanism().FindBody("tip");
  StepOptions step = Still(h);
  step.integrator = integrator;
  double far = 0;
  for (int i = 1; i * h < 0.6; ++i) {
    m.DriveBase(RigidTransform(Vector3(0, path(i * h), 0)));
    EXPECT_TRUE(world.Step(step).finite);
    far = std::max(far, std::abs(m.BodyPose(tip).translation().y() - path(i * h)));
  }
  return far;
}

// Whatever the step is beside what the interior takes to swing, what modes leave out moves as all of it
// would.
TEST(Interior, StaysWithABaseThatIsDrivenInShortSteps) {
  // 0.1 m aside within 0.2 s; a shake 40 times a second that takes a fifth of a second to reach 2 mm.
  const auto aside = [](double t) { return t < 0.2 ? 0.05 * (1 - std::cos(t * M_PI / 0.2)) : 0.1; };
  const auto shake = [](double t) { return 2e-3 * std::min(1.0, 5 * t) * std::sin(2 * M_PI * 40 * t); };
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage})
    for (const double h : {1.0 / 240, 1.0 / 960, 1.0 / 3840}) {
      SCOPED_TRACE((integrator == Integrator::kEuler ? "euler, h " : "two stages, h ") + std::to_string(h));
      // Slow beside the chain's second mode, so that little is left out: half a per cent.
      const double all = FarthestTip(integrator, 100, h, aside);
      EXPECT_GT(all, 0.1);
      EXPECT_NEAR(FarthestTip(integrator, 0, h, aside), all, 0.02 * all);
      // Faster than the chain's modes but the first, which the load column of the base's acceleration
      // carries.
      const double shaken = FarthestTip(integrator, 100, h, shake);
      EXPECT_NEAR(FarthestTip(integrator, 0, h, shake), shaken, 0.1 * shaken);
    }
}

}  // namespace
}  // namespace fork1s
