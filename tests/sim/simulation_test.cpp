// The object that users hold: names, inputs, hashes, keyframes.
#include <gtest/gtest.h>
#include <fork1s/sim/run_statistics.hpp>
#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <mechanisms.hpp>

#include <cmath>
#include <limits>

namespace fork1s {
namespace {

GeometryDef Shaped(const std::string& name, const Shape& shape) {
  GeometryDef g;
  g.name = name;
  g.shape = shape;
  return g;
}

// A chain of 10 links under its weight, of which the tip is an interface, without modes.
Scene SoftChain() {
  Scene scene;
  scene.mechanisms.push_back(testing::Chain(10, 0.05, 0.05, 20, 2));
  scene.mechanisms[0].name = "chain";
  scene.mechanisms[0].modes = 0;
  scene.gravity = Vector3(0, -9.81, 0);
  return scene;
}

// A servo finger, a chain on a driven base, a walker and a ball over a floor.
Scene TestScene() {
  Scene scene;
  scene.name = "test";
  MechanismDef finger = testing::Chain(2, 0.1, 0.1, 5, 0.1);
  finger.name = "finger";
  finger.bodies[0].name = "palm";
  for (std::size_t i = 1; i < finger.bodies.size(); ++i)
    finger.bodies[i].name = "finger_" + finger.bodies[i].name;
  for (JointDef& joint : finger.joints) joint.name = "finger_" + joint.name;
  finger.interfaces = {"finger_tip"};
  ControlDef grip;
  grip.name = "grip";
  grip.terms.emplace_back(FreedomRef{JointIndex(0), 0}, 1.0);
  grip.gain = 5;
  grip.is_setpoint = true;
  grip.lower = -0.5;
  grip.upper = 0.4;
  grip.initial = 0.1;
  finger.controls.push_back(grip);
  finger.X_WR = RigidTransform(Vector3(0, 0, 1));
  MechanismDef arm = testing::Chain(2, 0.1, 0.1, 50, 1);
  arm.name = "arm";
  arm.base = BaseKind::kDriven;
  arm.bodies[0].name = "hand";
  arm.X_WR = RigidTransform(Matrix3(ExpRotation(Vector3(0, 0, 0.3))), Vector3(2, 0, 1));
  MechanismDef walker = testing::Walker(BaseKind::kFloating, 20, 0.5);
  walker.bodies[0].name = "torso";
  for (BodyDef& body : walker.bodies)
    if (body.name.rfind("shank", 0) == 0) body.geometries.push_back(Shaped(body.name, Sphere{0.02}));
  walker.X_WR = RigidTransform(Vector3(-2, 0, 0.2));
  scene.mechanisms = {finger, arm, walker};
  FreeBodyDef ball;
  ball.name = "ball";
  ball.X_WB = RigidTransform(Vector3(0, 3, 0.1));
  ball.inertia = testing::Ball(1, 0.1);
  ball.geometries.push_back(Shaped("ball", Sphere{0.1}));
  scene.free_bodies.push_back(ball);
  scene.world.push_back(Shaped("floor", Plane{}));
  return scene;
}

Simulation MustCreate(const Scene& scene, const SimulationOptions& options = {}) {
  auto simulation = Simulation::Create(scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

// Every detection finds the law of a contact anew: recordings made before it had another field replay with the same state.
TEST(Simulation, LawsThatAreFoundAnew_AreNoPartOfTheState) {
  WorldState state;
  state.contacts.resize(1);
  const std::uint64_t hash = HashOf(state);
  ContactPoint& point = state.contacts[0].point;
  point.friction_scale << 0.5, 1;
  point.adhesion = 2;
  point.surface_velocity << 1, 2, 3;
  EXPECT_EQ(HashOf(state), hash);
  state.contacts[0].end_force.x() = 1;
  EXPECT_NE(HashOf(state), hash);
}

TEST(Simulation, ReportsWhyItRelinearizes) {
  auto simulation = Simulation::Create(SoftChain(), {});
  ASSERT_TRUE(simulation) << simulation.error().Text();
  const double angle = SimulationOptions{}.refresh_angle;
  RelinearizationTotals totals;
  int refreshes = 0;
  for (int i = 0; i < 240; ++i) {
    const Vector3 force(0, i < 120 ? 40 : 1000, 0);  // N
    simulation->ApplyWrench(5, force, Vector3::Zero(), simulation->Pose(5).translation());
    const StepReport report = simulation->Step();
    refreshes += report.refreshes;
    int by_cause = 0;
    for (const Relinearizations& r : report.refreshes_by_cause) by_cause += r.count;
    EXPECT_EQ(by_cause, report.refreshes) << i;
    AddRelinearizations(report, simulation->world(), totals);
  }
  const auto& [turned, missing, gap] = totals;
  EXPECT_EQ(turned.count + missing.count, refreshes);
  EXPECT_GT(turned.count, 0);
  EXPECT_GT(turned.largest.amount, angle);
  EXPECT_NEAR(turned.largest.share, turned.largest.amount / angle, 1e-12);
  EXPECT_EQ(turned.of.rfind("joint '", 0), 0U) << turned.of;
  EXPECT_GT(missing.count, 0);
  EXPECT_GT(missing.largest.amount, 1e-3);  // rad, from which a load asks for a column
  EXPECT_EQ(missing.of.rfind("joint '", 0), 0U) << missing.of;
  EXPECT_EQ(gap.count, 0) << "by exact recovery loops are closed";
  EXPECT_TRUE(gap.of.empty());
}

TEST(Simulation, ControlsHaveNamesAndLimits) {
  Simulation s = MustCreate(TestScene());
  const std::vector<std::string> names = {"grip",    "hand.x",  "hand.y", "hand.z",
                                          "hand.rx", "hand.ry", "hand.rz"};
  EXPECT_EQ(s.control_names(), names);
  EXPECT_EQ(s.FindControl("hand.rx"), 4);
  EXPECT_EQ(s.FindControl("grip "), -1);
  EXPECT_EQ(s.controls()(0), 0.1);
  s.SetControl("grip", 7);
  EXPECT_EQ(s.controls()(0), 0.4);
  s.SetControl(0, -7);
  EXPECT_EQ(s.controls()(0), -0.5);
  s.SetControl("hand.x", 1e3);
  EXPECT_EQ(s.controls()(1), 1e3);  // a driven base has no limits
  VectorX all = VectorX::Zero(7);
  all(0) = 0.2;
  s.SetControls(all);
  EXPECT_EQ(s.controls(), all);
  EXPECT_THROW(s.SetControl("thumb", 0), std::invalid_argument);
  EXPECT_THROW(s.SetControl(7, 0), std::invalid_argument);
  EXPECT_THROW(s.SetControl(-1, 0), std::invalid_argument);
  EXPECT_THROW(s.SetControl(0, std::numeric_limits<double>::quiet_NaN()), std::invalid_argument);
  EXPECT_THROW(s.SetControls(VectorX::Zero(3)), std::invalid_argument);
}

TEST(Simulation, ControlsReachTheirMechanisms) {
  Simulation s = MustCreate(TestScene());
  s.step_options().gravity.setZero();
  s.SetControl("grip", 0.3);
  s.SetControl("hand.y", 0.02);
  s.SetControl("hand.rz", 0.1);
  const RigidTransform start = s.Pose("hand");
  for (int i = 0; i < 600; ++i) s.Step();
  EXPECT_NEAR(s.world().mechanisms()[0].configuration().q(0), 0.3, 1e-6);
  EXPECT_NEAR(s.world().mechanisms()[0].configuration().q(1), 0.0, 1e-6);
  // Relative to the initial pose, turns about the world's axes.
  const RigidTransform hand = s.Pose("hand");
  EXPECT_LT((hand.translation() - start.translation() - Vector3(0, 0.02, 0)).norm(), 1e-15);
  const Matrix3 R = ExpRotation(Vector3(0, 0, 0.1)) * start.rotation();
  EXPECT_LT((hand.rotation() - R).norm(), 1e-14);
}

TEST(Simulation, BodiesByName) {
  Simulation s = MustCreate(TestScene());
  const int tip = s.FindBody("finger_tip"), ball = s.FindBody("ball");
  ASSERT_GE(tip, 0);
  ASSERT_GE(ball, 0);
  EXPECT_TRUE(s.bodies()[static_cast<std::size_t>(tip)].is_interface);
  EXPECT_FALSE(s.bodies()[static_cast<std::size_t>(s.FindBody("finger_link1"))].is_interface);
  EXPECT_EQ(s.bodies()[static_cast<std::size_t>(ball)].mechanism, -1);
  EXPECT_EQ(s.Pose("ball").translation(), Vector3(0, 3, 0.1));
  EXPECT_LT((s.Pose(tip).translation() - Vector3(0.2, 0, 1)).norm(), 1e-15);
  EXPECT_EQ(s.FindBody("nobody"), -1);
  EXPECT_THROW((void)s.Pose("nobody"), std::invalid_argument);
  EXPECT_THROW((void)s.Pose(-1), std::invalid_argument);
  EXPECT_THROW((void)s.Velocity(1000), std::invalid_argument);
  EXPECT_THROW(s.ApplyWrench(1000, Vector3::Zero(), Vector3::Zero(), Vector3::Zero()), std::invalid_argument);
  const Vector3 nan = Vector3::Constant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_THROW(s.ApplyWrench(ball, nan, Vector3::Zero(), Vector3::Zero()), std::invalid_argument);
}

TEST(Simulation, WrenchesActForOneStep) {
  Simulation s = MustCreate(TestScene());
  s.step_options().gravity.setZero();
  const int ball = s.FindBody("ball");
  s.ApplyWrench(ball, Vector3(0, 6, 0), Vector3::Zero(), Vector3(0, 3, 0.1));
  s.Step();
  const double v = 6 * s.dt();
  EXPECT_NEAR(s.Velocity(ball)(4), v, 1e-12);
  s.Step();
  EXPECT_NEAR(s.Velocity(ball)(4), v, 1e-12);
}

TEST(Simulation, TimeAndStep) {
  Scene scene = TestScene();
  scene.timestep = 0.01;
  Simulation s = MustCreate(scene);
  EXPECT_EQ(s.dt(), 0.01);
  for (int i = 0; i < 7; ++i) s.Step();
  EXPECT_EQ(s.steps(), 7);
  EXPECT_EQ(s.time(), 7 * 0.01);
  SimulationOptions options;
  options.dt = 0.002;
  EXPECT_EQ(MustCreate(scene, options).dt(), 0.002);
  scene.timestep = 0;
  const auto failed = Simulation::Create(scene);
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().code, ErrorCode::kModel);
}

TEST(Simulation, TwoRunsAreTheSameBits) {
  Simulation a = MustCreate(TestScene()), b = MustCreate(TestScene());
  EXPECT_EQ(a.HashState(), b.HashState());
  for (int i = 0; i < 300; ++i) {
    for (Simulation* s : {&a, &b}) {
      s->SetControl("grip", 0.3 * std::sin(0.1 * i));
      s->SetControl("hand.x", 0.1 * std::sin(0.05 * i));
      s->Step();
    }
    ASSERT_EQ(a.HashState(), b.HashState()) << i;
  }
}

TEST(Simulation, HashSeesOneBit) {
  Simulation a = MustCreate(TestScene());
  const std::uint64_t before = a.HashState();
  FreeBody& ball = a.world().free_bodies()[0];
  const RigidTransform X = ball.pose();
  RigidTransform moved = X;
  moved.translation().y() = std::nextafter(moved.translation().y(), 10);
  ball.SetState(moved, Vector3::Zero(), Vector3::Zero());
  EXPECT_NE(a.HashState(), before);
  ball.SetState(X, Vector3::Zero(), Vector3::Zero());
  EXPECT_EQ(a.HashState(), before);
  ball.SetState(X, Vector3::Zero(), Vector3(0, 0, std::numeric_limits<double>::denorm_min()));
  EXPECT_NE(a.HashState(), before);
}

KeyframeDef Key(const Scene& scene) {
  KeyframeDef key;
  key.name = "up";
  for (const MechanismDef& m : scene.mechanisms) {
    KeyframeDef::MechanismState state;
    int n = 0;
    for (const JointDef& joint : m.joints) n += static_cast<int>(joint.freedoms.size());
    state.q = VectorX::Zero(n);
    state.q_dot = VectorX::Zero(n);
    state.X_WR = m.X_WR;
    key.mechanisms.push_back(state);
  }
  key.free_bodies.push_back({scene.free_bodies[0].X_WB, Vector3::Zero(), Vector3::Zero()});
  return key;
}

TEST(Simulation, StartsAtAKeyframe) {
  Scene scene = TestScene();
  KeyframeDef key = Key(scene);
  key.mechanisms[0].q << 0.2, -0.1;
  key.mechanisms[0].q_dot << 1, 2;
  key.mechanisms[0].controls = VectorX::Constant(1, 0.35);
  key.mechanisms[2].X_WR = RigidTransform(Vector3(-3, 1, 2));
  key.mechanisms[2].V_R << 0, 0, 1, 0.5, 0, 0;
  key.free_bodies[0] = {RigidTransform(Vector3(1, 5, 4)), Vector3(0, 0, 3), Vector3(1, 0, 0)};
  scene.keyframes.push_back(key);
  SimulationOptions options;
  options.initial_keyframe = 0;
  Simulation s = MustCreate(scene, options);
  const MechanismDynamics& finger = s.world().mechanisms()[0];
  EXPECT_LT((finger.configuration().q - key.mechanisms[0].q).norm(), 1e-15);
  EXPECT_LT((finger.configuration().Q_now * finger.state().w - key.mechanisms[0].q_dot).norm(), 1e-12);
  EXPECT_EQ(s.controls()(0), 0.35);
  EXPECT_LT((s.Pose("torso").translation() - Vector3(-3, 1, 2)).norm(), 1e-15);
  EXPECT_LT((s.Velocity(s.FindBody("torso")) - key.mechanisms[2].V_R).norm(), 1e-12);
  EXPECT_LT((s.Pose("ball").translation() - Vector3(1, 5, 4)).norm(), 1e-15);
  EXPECT_NEAR(s.Velocity(s.FindBody("ball"))(2), 3, 1e-15);
  EXPECT_NEAR(s.Velocity(s.FindBody("ball"))(3), 1, 1e-15);
  // One bit of a joint's start is another state.
  Scene other = scene;
  other.keyframes[0].mechanisms[0].q(0) = std::nextafter(0.2, 1);
  EXPECT_NE(MustCreate(other, options).HashState(), s.HashState());
}

// All at once they are what each is by itself, whatever recovers them.
TEST(Simulation, PosesAreThoseOfTheBodies) {
  for (const Recovery recovery : {Recovery::kExact, Recovery::kCurved, Recovery::kTwist}) {
    SimulationOptions options;
    options.recovery = recovery;
    Simulation s = MustCreate(TestScene(), options);
    for (int i = 0; i < 20; ++i) s.Step();
    std::vector<RigidTransform> X_WB;
    s.Poses(X_WB);
    ASSERT_EQ(X_WB.size(), s.bodies().size());
    for (std::size_t b = 0; b < X_WB.size(); ++b) {
      const RigidTransform own = s.Pose(static_cast<int>(b));
      EXPECT_EQ(own.translation(), X_WB[b].translation()) << Name(recovery) << ' ' << b;
      EXPECT_EQ(own.rotation(), X_WB[b].rotation()) << Name(recovery) << ' ' << b;
    }
  }
}

}  // namespace
}  // namespace fork1s
