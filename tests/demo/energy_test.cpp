// Energy of mechanisms on which nothing acts from outside: it never grows, however stiff they are.
#include <ostream>
#include <random>

#include "support.hpp"

namespace fork1s::examples {
namespace {

struct Case {
  const char* scene;
  const char* struck;  // body that is kicked
  double stiffness;
};

std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.scene << " x" << c.stiffness; }

// No gravity, nothing to touch, no free bodies, base fixed unless it floats, rest pose at the reference.
Scene Alone(const Case& c) {
  ImportOptions options;
  options.stiffness_scale = c.stiffness;
  ImportedScene imported = Load(c.scene, options);
  Scene scene = std::move(imported.scene);
  scene.gravity.setZero();
  scene.world.clear();
  scene.free_bodies.clear();
  scene.keyframes.clear();
  MechanismDef& m = scene.mechanisms[0];
  if (m.base == BaseKind::kDriven) m.base = BaseKind::kFixed;
  for (BodyDef& body : m.bodies)
    for (GeometryDef& g : body.geometries) g.contype = g.conaffinity = 0;
  return scene;
}

// Rounding: energies are sums of products of size E, here of stored and kinetic parts that change places.
constexpr double kRounding = 1e-10;
// A floating base keeps its momentum to rounding and its energy to third order in the turn of a step. What
// that gains is taken from the motion of the joints, of which there is none while they turn back: then it
// stays, here below 1e-7.
constexpr double kTurn = 1e-7;

void ExpectNoGrowth(Simulation& simulation, int steps) {
  const bool floats = simulation.scene().mechanisms[0].base == BaseKind::kFloating;
  double before = simulation.Energy();
  const double start = before;
  for (int i = 0; i < steps; ++i) {
    const StepReport report = simulation.Step();
    ASSERT_TRUE(report.finite) << i;
    const double now = simulation.Energy();
    EXPECT_LE((now - before) / start, floats ? kTurn : kRounding) << "step " << i << " of energy " << start;
    before = now;
  }
  EXPECT_LT(before, start);
}

class Energy : public testing::TestWithParam<Case> {};

// Bent by up to 11 degrees at every joint, then let go.
TEST_P(Energy, NeverGrowsAfterAPluck) {
  Scene scene = Alone(GetParam());
  const MechanismDef& m = scene.mechanisms[0];
  KeyframeDef key;
  key.mechanisms.emplace_back();
  auto& state = key.mechanisms[0];
  state.X_WR = m.X_WR;
  Eigen::Index n = 0;
  for (const JointDef& joint : m.joints) n += static_cast<Eigen::Index>(joint.freedoms.size());
  state.q.resize(n);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> angle(-0.19, 0.19);
  for (double& q : state.q) q = angle(random);
  state.q_dot = VectorX::Zero(n);
  state.controls = VectorX::Zero(static_cast<Eigen::Index>(m.controls.size()));
  scene.keyframes = {key};
  // Loops are closed from there, so the pose is a possible one.
  Simulation simulation = Start(std::move(scene), 0);
  ExpectNoGrowth(simulation, 240);
}

// Struck at one body during one step by the same blow, 0.22 N s: the speeds of a hard knock, whatever the
// stiffness.
TEST_P(Energy, NeverGrowsAfterAStrike) {
  Simulation simulation = Start(Alone(GetParam()));
  const int body = simulation.FindBody(GetParam().struck);
  ASSERT_GE(body, 0);
  const Vector3 force = 10 * Vector3(1, 0.5, -0.7);  // N, over one step
  simulation.ApplyWrench(body, force, Vector3::Zero(), simulation.Pose(body).translation());
  simulation.Step();
  EXPECT_GT(simulation.Energy(), 0);
  ExpectNoGrowth(simulation, 240);
}

// Hit by a ball of 50 g at 1 m/s. Impact takes energy, and the ball's is counted. Penetration beyond the slop
// would be pushed out again and would add some; none gets that deep here.
TEST_P(Energy, NeverGrowsWhenABallHits) {
  Scene scene = Alone(GetParam());
  MechanismDef& m = scene.mechanisms[0];
  const BodyIndex struck = m.FindBody(GetParam().struck);
  ASSERT_TRUE(struck.valid());
  const RigidTransform X_WB = Start(scene).Pose(GetParam().struck);
  const Vector3 from = Vector3(0.5, 0.4, -0.77).normalized();
  constexpr double kRadius = 0.02;  // m
  FreeBodyDef ball;
  ball.name = "ball";
  ball.inertia.mass = 0.05;
  ball.inertia.rotational = 0.4 * ball.inertia.mass * kRadius * kRadius * Matrix3::Identity();
  GeometryDef shape;
  shape.shape = Sphere{kRadius};
  ball.geometries = {shape};
  const GeometryDef& target =
      m.bodies[struck.u()].geometries.back();  // the pads and feet of these scenes stand last
  m.bodies[struck.u()].geometries.back().contype = 1;
  ball.X_WB.translation() =
      X_WB * target.X_BG.translation() + (BoundingRadius(target.shape) + kRadius + 0.002) * from;
  KeyframeDef key;
  key.mechanisms.emplace_back();
  key.mechanisms[0].X_WR = m.X_WR;
  const VectorX zero = VectorX::Zero(static_cast<Eigen::Index>(m.joints.size()));  // hinges only
  key.mechanisms[0].q = key.mechanisms[0].q_dot = zero;
  key.mechanisms[0].controls = VectorX::Zero(static_cast<Eigen::Index>(m.controls.size()));
  key.free_bodies.push_back({ball.X_WB, Vector3::Zero(), -from});
  scene.free_bodies = {ball};
  scene.keyframes = {key};
  Simulation simulation = Start(std::move(scene), 0);
  int touched = 0;
  const double start = simulation.Energy();
  EXPECT_NEAR(start, 0.5 * 0.05, 1e-9);
  double before = start;
  for (int i = 0; i < 240; ++i) {
    const StepReport report = simulation.Step();
    ASSERT_TRUE(report.finite) << i;
    touched += report.contacts;
    EXPECT_LT(report.max_penetration, 5e-4) << i;
    const double now = simulation.Energy();
    EXPECT_LE((now - before) / start, kTurn) << i;
    before = now;
  }
  EXPECT_GT(touched, 0);
  EXPECT_LT(before, start);
}

INSTANTIATE_TEST_SUITE_P(
    Mechanisms, Energy,
    testing::Values(Case{"hand", "index_tip", 1}, Case{"hand", "index_tip", 1e3},
                    Case{"hand", "index_tip", 1e6}, Case{"fourbar_gripper", "left_jaw", 1},
                    Case{"fourbar_gripper", "left_jaw", 1e3}, Case{"fourbar_gripper", "left_jaw", 1e6},
                    Case{"hexapod", "front_left_tibia", 1}, Case{"hexapod", "front_left_tibia", 1e3},
                    Case{"hexapod", "front_left_tibia", 1e6}));

}  // namespace
}  // namespace fork1s::examples
