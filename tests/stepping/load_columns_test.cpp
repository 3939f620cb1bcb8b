// Load columns in motion: what the interface does not feel moves by the equation of motion, with its inertia.
#include <random_mechanism.hpp>
#include <stepping/support.hpp>

#include "linalg/cholesky.hpp"

namespace fork1s {
namespace {

using testing::TwoStage;

World ChainUnder(const MechanismDef& chain, const Vector3& gravity, int modes) {
  Scene scene;
  scene.gravity = gravity;
  scene.mechanisms.push_back(chain);
  World::Options options;
  options.reduction.modes = modes;
  return testing::MustCreate(scene, options);
}

const Vector3 kAcross(0, -9.81, 0);  // m/s², in the plane of testing::Chain

struct Fall {
  Vector3 tip;
  double gain = 0;  // energy beyond that of the start, of the largest kinetic energy
  int refreshes = 0;
};

// A chain of 60 links and 1.8 m that whips down from horizontal.
Fall FallOfChain(int modes, double h, int steps) {
  MechanismDef chain = testing::Chain(60, 0.03, 0.02, 0.05, 0.0005);
  for (BodyDef& link : chain.bodies) {
    if (!(link.inertia.mass > 0)) continue;
    link.inertia = testing::Brick(0.02, Vector3(0.023, 0.009, 0.009));
    link.inertia.center = Vector3(0.015, 0, 0);
  }
  World world = ChainUnder(chain, kAcross, modes);
  const MechanismDynamics& m = world.mechanisms()[0];
  EXPECT_EQ(m.model().has_complement, modes < 60);
  const StepOptions step = TwoStage(h, kAcross);
  const double start = world.PotentialEnergy(kAcross);
  double kinetic = 0, highest = start;
  int refreshes = 0;
  for (int i = 0; i < steps; ++i) {
    const StepReport report = world.Step(step);
    EXPECT_TRUE(report.finite && report.stages_converged) << modes << " modes, step " << i;
    refreshes += report.refreshes;
    kinetic = std::max(kinetic, world.KineticEnergy());
    highest = std::max(highest, world.KineticEnergy() + world.PotentialEnergy(kAcross));
  }
  return {m.BodyPose(m.mechanism().FindBody("tip")).translation(), (highest - start) / kinetic, refreshes};
}

TEST(LoadColumns, WhippingChainEndsWhereThatOfAllJointsDoes) {
  const Fall all = FallOfChain(60, 1.0 / 240, 240), few = FallOfChain(4, 1.0 / 240, 240);
  EXPECT_LT((few.tip - all.tip).norm(), 0.02);
  EXPECT_LT(few.gain, 1e-3);
  EXPECT_LT(few.refreshes, 30);  // of joints that have turned by 15 degrees
  EXPECT_LT((FallOfChain(4, 1.0 / 960, 960).tip - all.tip).norm(), 0.02);
}

// rad by which a joint of a cantilever of 24 links rests elsewhere than in a model of all joints.
double ShapeErrorAtRest(int modes) {
  const MechanismDef beam = testing::Chain(24, 0.05, 0.02, 100, 20);
  VectorX q[2];
  for (const int all : {0, 1}) {
    World world = ChainUnder(beam, kAcross, all ? 24 : modes);
    for (int i = 0; i < 600; ++i) EXPECT_TRUE(world.Step(TwoStage(1.0 / 60, kAcross)).finite);
    EXPECT_LT(world.KineticEnergy(), 1e-12);
    q[all] = world.mechanisms()[0].configuration().q;
  }
  EXPECT_GT(q[1].cwiseAbs().sum(), 0.15);
  return (q[1] - q[0]).cwiseAbs().maxCoeff();
}

TEST(LoadColumns, BeamSagsToTheShapeOfAllJoints) { EXPECT_LT(ShapeErrorAtRest(0), 1e-3); }

// Where the tip of a chain of 10 links, heavy in the middle, is farthest from its base [m], which moves 0.1 m
// aside within 0.2 s.
double LargestSwing(int modes, double h) {
  MechanismDef chain = testing::Chain(10, 0.05, 0.05, 18, 0.01);
  chain.base = BaseKind::kDriven;
  chain.bodies[5].inertia = testing::Rod(0.5, 0.05);
  World world = ChainUnder(chain, Vector3::Zero(), modes);
  MechanismDynamics& m = world.mechanisms()[0];
  const BodyIndex tip = m.mechanism().FindBody("tip");
  double far = 0;
  for (int i = 1; i * h < 0.6; ++i) {
    const double aside = i * h < 0.2 ? 0.05 * (1 - std::cos(i * h * M_PI / 0.2)) : 0.1;
    m.DriveBase(RigidTransform(Vector3(0, aside, 0)));
    EXPECT_TRUE(world.Step(TwoStage(h)).finite);
    far = std::max(far, std::abs(m.BodyPose(tip).translation().y() - aside));
  }
  return far;
}

TEST(LoadColumns, ChainOnDrivenBaseSwingsAsThatOfAllJoints) {
  for (const double h : {1.0 / 240, 1.0 / 960}) {
    const double all = LargestSwing(10, h);
    EXPECT_GT(all, 0.1);
    EXPECT_NEAR(LargestSwing(0, h), all, 0.02 * all);
  }
}

// Joints of a damped chain, fixed at one end, 4 s after a force was put on a body that the interface does not
// feel.
VectorX RestUnderForce(int modes, bool by_spring) {
  MechanismDef chain = testing::Chain(10, 0.05, 0.05, 20, 2);
  World world = ChainUnder(chain, kAcross, modes);
  MechanismDynamics& m = world.mechanisms()[0];
  const BodyIndex pushed(5);
  const Vector3 force(0, 40, 0);  // N
  if (by_spring) {
    const Vector3 target = m.BodyPose(pushed).translation() + Vector3(0, 0.2, 0);
    m.SetPointSpring(pushed, {.target_start_W = target, .target_W = target, .stiffness = 400, .damping = 5});
  }
  int refreshes = 0;
  for (int i = 0; i < 240; ++i) {
    if (!by_spring) m.AddWrench(pushed, force, Vector3::Zero(), m.BodyPose(pushed).translation());
    const StepReport report = world.Step(TwoStage(1.0 / 60, kAcross));
    EXPECT_TRUE(report.finite);
    refreshes += report.refreshes;
  }
  EXPECT_LT(refreshes, 12) << modes;
  return m.configuration().q;
}

TEST(LoadColumns, HeldForcesOnInteriorBodiesBendItAsTheyBendAllJoints) {
  for (const bool by_spring : {false, true}) {
    const VectorX all = RestUnderForce(10, by_spring);
    EXPECT_GT(all.cwiseAbs().maxCoeff(), 0.1);
    // rad, the size that a load column is asked for
    EXPECT_LT((RestUnderForce(0, by_spring) - all).cwiseAbs().maxCoeff(), 1e-3) << by_spring;
  }
}

// rad by which a joint of a chain of ten, of stiffness k, rests elsewhere under 1 N across its fifth body
// than where the interface, its tip, moves the joints to: what is left of K⁻¹ τ by least squares in the
// metric of K.
double MissedPerNewton(double k, double length) {
  MatrixX J = MatrixX::Zero(3, 10);  // turn, x and y of the tip in the plane
  VectorX answer = VectorX::Zero(10);
  for (int i = 0; i < 10; ++i) {
    J(0, i) = 1;
    J(2, i) = (9 - i) * length;
    answer(i) = std::max(0, 4 - i) * length / k;
  }
  const MatrixX A = J.transpose();
  const VectorX moved = A * SolveSymmetric(A.transpose() * A, A.transpose() * answer);
  return (answer - moved).cwiseAbs().maxCoeff();
}

TEST(LoadColumns, ForcesGetOneFromAMilliradianOn) {
  for (const double share : {0.99, 1.01}) {
    const MechanismDef chain = testing::Chain(10, 0.05, 0.05, 1e4, 2);
    World world = ChainUnder(chain, Vector3::Zero(), 0);
    MechanismDynamics& m = world.mechanisms()[0];
    const Vector3 force(0, share * 1e-3 / MissedPerNewton(1e4, 0.05), 0);
    int refreshes = 0;
    for (int i = 0; i < 20; ++i) {
      m.AddWrench(BodyIndex(5), force, Vector3::Zero(), m.BodyPose(BodyIndex(5)).translation());
      refreshes += world.Step(TwoStage(1.0 / 60)).refreshes;
    }
    EXPECT_EQ(refreshes, share > 1 ? 1 : 0) << share;
  }
}

// A force that comes and goes has one from the end of its first step on.
TEST(LoadColumns, ForcesThatComeBackMakeOneReference) {
  const Vector3 force(0, 3 * 1e-3 / MissedPerNewton(1e4, 0.05), 0);
  World world = ChainUnder(testing::Chain(10, 0.05, 0.05, 1e4, 2), Vector3::Zero(), 0);
  MechanismDynamics& m = world.mechanisms()[0];
  for (int i = 0; i < 12; ++i) {
    if (i % 4 < 2) m.AddWrench(BodyIndex(5), force, Vector3::Zero(), m.BodyPose(BodyIndex(5)).translation());
    EXPECT_EQ(world.Step(TwoStage(1.0 / 60)).refreshes, i == 0 ? 1 : 0) << i;
  }
}

// On another body in each step: a reference costs as much as three steps, and each is three steps after the
// last.
TEST(LoadColumns, LoadsMakeAReferenceInThreeSteps) {
  const Vector3 force(0, 30 * 1e-3 / MissedPerNewton(1e4, 0.05), 0);
  World world = ChainUnder(testing::Chain(10, 0.05, 0.05, 1e4, 2), Vector3::Zero(), 0);
  MechanismDynamics& m = world.mechanisms()[0];
  for (int i = 0; i < 16; ++i) {
    const BodyIndex body(3 + i % 4);
    m.AddWrench(body, force, Vector3::Zero(), m.BodyPose(body).translation());
    const StepReport report = world.Step(TwoStage(1.0 / 60));
    EXPECT_EQ(report.refreshes, i % 3 == 0 ? 1 : 0) << i;
  }
}

// Ten bodies that slide along y, each on the one before it, the last one the interface: it sees the sum of
// all slides, so a force f on the fifth leaves f / 2k in each unseen, and a slide of u in one 0.9 u.
MechanismDef Slides(double stiffness) {
  MechanismDef chain = testing::Chain(10, 0.05, 0.05, stiffness, 2);
  for (std::size_t j = 0; j < chain.joints.size(); ++j) {
    JointDef& joint = chain.joints[j];
    joint = JointDef::Slide(joint.name, joint.body, Vector3::UnitY()).WithSpring(stiffness, 400);
  }
  ControlDef servo;
  servo.name = "servo";
  servo.terms = {{{JointIndex(4), 0}, 1.0}};
  servo.gain = stiffness;
  servo.is_setpoint = true;
  chain.controls.push_back(servo);
  return chain;
}

TEST(LoadColumns, SlidesGetOneFromAThousandthOfTheLengthOn) {
  constexpr double kStiffness = 1e4;  // N/m
  for (const double share : {0.99, 1.01}) {
    World forced = ChainUnder(Slides(kStiffness), Vector3::Zero(), 0);
    MechanismDynamics& m = forced.mechanisms()[0];
    const double missing = share * 1e-3 * m.mechanism().length_scale();  // m
    int refreshes = 0;
    for (int i = 0; i < 120; ++i) {
      m.AddWrench(BodyIndex(5), Vector3(0, 2 * kStiffness * missing, 0), Vector3::Zero(),
                  m.BodyPose(BodyIndex(5)).translation());
      refreshes += forced.Step(TwoStage(1.0 / 60)).refreshes;
    }
    EXPECT_EQ(refreshes, share > 1 ? 1 : 0) << share;

    World driven = ChainUnder(Slides(kStiffness), Vector3::Zero(), 0);
    MechanismDynamics& d = driven.mechanisms()[0];
    d.controls()(0) = missing / 0.9;
    d.MoveControls();
    EXPECT_EQ(driven.Step(TwoStage(1.0 / 60)).refreshes, share > 1 ? 1 : 0) << share;
  }
}

// A chain of 12 links with servos, of which the fourth, sixth and eighth go to 0.5 rad within `ramp` s:
// largest difference of a joint from the model of all joints [rad] while they move and at rest.
struct Lag {
  double moving = 0, resting = 0;
  int refreshes = 0;
};

Lag LagOfSetPoints(int modes, double ramp) {
  MechanismDef chain = testing::Chain(12, 0.05, 0.05, 20, 0.5, true);
  for (int j = 0; j < 12; ++j) {
    ControlDef servo;
    servo.name = "servo" + std::to_string(j + 1);
    servo.terms = {{{JointIndex(j), 0}, 1.0}};
    servo.gain = 20;
    servo.is_setpoint = true;
    chain.controls.push_back(servo);
  }
  World few = ChainUnder(chain, testing::kDown, modes), all = ChainUnder(chain, testing::kDown, 12);
  Lag lag;
  constexpr double h = 1.0 / 60;
  for (int i = 1; i * h < ramp + 2; ++i) {
    VectorX q[2];
    for (World* world : {&few, &all}) {
      MechanismDynamics& m = world->mechanisms()[0];
      for (const int joint : {3, 5, 7}) m.controls()(joint) = 0.5 * std::min(1.0, i * h / ramp);
      m.MoveControls();
      const StepReport report = world->Step(TwoStage(h, testing::kDown));
      EXPECT_TRUE(report.finite);
      if (world == &few) lag.refreshes += report.refreshes;
      q[world == &all] = m.configuration().q;
    }
    const double off = (q[1] - q[0]).cwiseAbs().maxCoeff();
    if (i * h < ramp) lag.moving = std::max(lag.moving, off);
    lag.resting = off;
  }
  return lag;
}

TEST(LoadColumns, SetPointsOfCondensedJointsMoveThemAsInTheModelOfAllJoints) {
  for (const int modes : {0, 4}) {
    for (const double ramp : {0.5, 3.0}) {
      const Lag lag = LagOfSetPoints(modes, ramp);
      // Of what they move in a step: the first one has no column yet.
      EXPECT_LT(lag.moving, 0.2 * 0.5 / (60 * ramp)) << modes << " modes, " << ramp << " s";
      EXPECT_LT(lag.resting, 1e-6) << modes << " modes, " << ramp << " s";
      EXPECT_LE(lag.refreshes, 3) << modes << " modes, " << ramp << " s";
    }
  }
}

// Trees and loops of hinges, thrown off their rest and damped, under a weight that bends them.
TEST(LoadColumns, RandomMechanismsComeToRestWhereThoseOfAllJointsDo) {
  const Vector3 weak(0.3, -0.5, -1);  // m/s²: heavier ones may have several equilibria
  const StepOptions step = TwoStage(1.0 / 60, weak);
  int truncated = 0;
  for (unsigned seed = 0; seed < 16; ++seed) {
    SCOPED_TRACE(seed);
    testing::RandomMechanismOptions options;
    options.bodies = 12;
    options.interfaces = 1;
    options.rigid_closures = static_cast<int>(seed % 2);
    options.damping_ratio = 0.05;
    options.hinges_only = true;
    options.rest = true;
    const MechanismDef definition = testing::RandomMechanismDef(seed, options);
    const int n = testing::Share(definition)->num_coordinates();
    std::vector<Vector3> at[2];
    double turned = 0, size = 0;
    int left_out = 0;
    for (const bool all : {false, true}) {
      World::Options world_options;
      world_options.reduction.modes = all ? n : 1;
      Scene scene = testing::Started(definition, VectorX::Zero(n), testing::RandomSource(seed).Vector(n, 20));
      scene.gravity = weak;
      world_options.initial_keyframe = 0;
      World world = testing::MustCreate(scene, world_options);
      const MechanismDynamics& m = world.mechanisms()[0];
      if (!all) left_out = m.model().has_complement ? 1 : 0;
      for (int i = 0; i < 900; ++i) {
        ASSERT_TRUE(world.Step(step).finite);
        turned = std::max(turned, m.configuration().q.cwiseAbs().maxCoeff());
      }
      for (int b = 0; b < m.mechanism().num_bodies(); ++b)
        at[all].push_back(m.BodyPose(BodyIndex(b)).translation());
    }
    if (left_out == 0) continue;
    ++truncated;
    double off = 0;
    for (std::size_t b = 0; b < at[0].size(); ++b) {
      off = std::max(off, (at[0][b] - at[1][b]).norm());
      size = std::max(size, (at[1][b] - at[1][0]).norm());
    }
    EXPECT_LT(off, 1e-3 * size);
    EXPECT_GT(turned, 0.5);
  }
  EXPECT_GT(truncated, 5);
}

// Weight that inertia carries bends nothing.
TEST(LoadColumns, SoftChainInFreeFallKeepsItsReference) {
  MechanismDef chain = testing::Chain(20, 0.05, 0.05, 0.05, 0.001);
  chain.base = BaseKind::kFloating;
  World world = ChainUnder(chain, kAcross, 2);
  ASSERT_TRUE(world.mechanisms()[0].model().has_complement);
  int refreshes = 0;
  for (int i = 0; i < 120; ++i) refreshes += world.Step(TwoStage(1.0 / 60, kAcross)).refreshes;
  EXPECT_EQ(refreshes, 0);
}

}  // namespace
}  // namespace fork1s
