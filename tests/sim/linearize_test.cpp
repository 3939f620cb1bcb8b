// A step to first order: against the matrix of the scheme itself, geometry, and motions that start beside the state.
#include <cmath>
#include <fork1s/sim/linearize.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <functional>

#include "linalg/solve.hpp"
#include "mechanisms.hpp"
#include "random_mechanism.hpp"
#include "sim/gripper.hpp"

namespace fork1s {
namespace {

using testing::Gripper;
using testing::RandomSource;

constexpr double kStep = 1.0 / 60;

Simulation StartFrom(const Scene& scene, Integrator integrator = Integrator::kTwoStage) {
  SimulationOptions options;
  options.dt = kStep;
  options.step.integrator = integrator;
  auto simulation = Simulation::Create(scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

Scene SceneOf(const MechanismDef& definition) {
  Scene scene;
  scene.name = definition.name;
  scene.mechanisms.push_back(definition);
  return scene;
}

LinearizedStep LinearizeOrThrow(Simulation& simulation, const LinearizeOptions& options = {}) {
  const std::uint64_t before = simulation.HashState();
  const double time = simulation.time();
  auto out = Linearize(simulation, options);
  if (!out) throw std::runtime_error(out.error().Text());
  EXPECT_EQ(simulation.HashState(), before);
  EXPECT_EQ(simulation.time(), time);
  return std::move(*out);
}

// x' of ẋ = J x by the scheme: 1/(1 - Z) of backward Euler, (1 + (1 - 2γ) Z)/(1 - γ Z)² of Alexander's two stages,
// Z = J h, γ = 1 - 1/√2.
MatrixX SchemeMatrix(const MatrixX& J, Integrator integrator) {
  const MatrixX one = MatrixX::Identity(J.rows(), J.cols()), Z = J * kStep;
  if (integrator == Integrator::kEuler) return SolveSquare(one - Z, one);
  const double gamma = 1 - std::sqrt(0.5);
  return SolveSquare(one - gamma * Z, SolveSquare(one - gamma * Z, one + (1 - 2 * gamma) * Z));
}

// A cart [1 kg] on springs with a rod [0.2 kg, 0.5 m] that stands on it, and a control of the cart.
struct CartAndPole {
  double cart = 1, pole = 0.2, length = 0.5, k = 30, damping = 2, gain = 30;
  double lag = 0;  // s, of the control

  Scene Make() const {
    MechanismBuilder builder("cart_and_pole");
    BodyDef body;
    body.name = "cart";
    body.parent = builder.base();
    body.inertia = testing::Brick(cart, Vector3::Constant(0.05));
    const BodyIndex on = builder.AddBody(body);
    const JointIndex rail =
        builder.AddJoint(JointDef::Slide("rail", on, Vector3::UnitX()).WithSpring(k, damping));
    body.name = "pole";
    body.parent = on;
    const Matrix3 up = Eigen::AngleAxisd(-M_PI / 2, Vector3::UnitY()).matrix();
    body.inertia = Transform(RigidTransform(up, Vector3::Zero()), testing::Rod(pole, length));
    builder.AddJoint(JointDef::Hinge("pivot", builder.AddBody(body), Vector3::UnitY()));
    ControlDef control;
    control.name = "drive";
    control.terms.emplace_back(FreedomRef{rail, 0}, 1.0);
    control.gain = gain;
    if (lag > 0) {
      control.dynamics = ControlDynamics::kLag;
      control.time_constant = lag;
    }
    builder.AddControl(control);
    builder.SetInterfaces({"cart", "pole"});
    return SceneOf(builder.definition());
  }

  // Of [x, θ, ẋ, θ̇, u] about the pole upright, θ turns towards x.
  MatrixX Jacobian() const {
    const double a = length / 2, I = pole * length * length / 12 + pole * a * a;
    MatrixX M(2, 2), K(2, 2);
    M << cart + pole, pole * a, pole * a, I;
    K << k, 0, 0, -pole * 9.81 * a;
    MatrixX J = MatrixX::Zero(5, 5);
    J.block(0, 2, 2, 2).setIdentity();
    J.block(2, 0, 2, 2) = -SolveSquare(M, K);
    J.block(2, 2, 2, 1) = -SolveSquare(M, Vector2(damping, 0));
    J.block(2, 4, 2, 1) = SolveSquare(M, Vector2(gain, 0));
    return J;
  }
};

class LinearizeCart : public ::testing::TestWithParam<Integrator> {};
INSTANTIATE_TEST_SUITE_P(Integrators, LinearizeCart,
                         ::testing::Values(Integrator::kEuler, Integrator::kTwoStage));

TEST_P(LinearizeCart, PoleUpright_MatrixOfTheScheme) {
  const CartAndPole given;
  Simulation simulation = StartFrom(given.Make(), GetParam());
  const LinearizedStep step = LinearizeOrThrow(simulation);
  EXPECT_EQ(step.coordinates, (std::vector<std::string>{"rail", "pivot"}));
  EXPECT_EQ(step.inputs, std::vector<std::string>{"drive"});
  const MatrixX expected = SchemeMatrix(given.Jacobian(), GetParam());
  // Changes of 1e-6, of which rounding leaves 1e-15 of a length, in rates over a stage of 0.3 of the step.
  const Vector4 units(1, 1, kStep, kStep);
  const MatrixX A = units.asDiagonal() * (step.A - expected.topLeftCorner(4, 4)) *
                    units.cwiseInverse().asDiagonal(),
                B = units.asDiagonal() * (step.B - expected.topRightCorner(4, 1));
  EXPECT_LT(A.cwiseAbs().maxCoeff(), 3e-7) << step.A;
  EXPECT_LT(B.cwiseAbs().maxCoeff(), 3e-7) << step.B;
  EXPECT_LT(step.c.cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT(step.difference, 1e-6);
  EXPECT_TRUE(step.switches.empty());
}

// [x, θ, ẋ, θ̇] after a step that begins at 0, with the activation by the share of the step.
Vector4 StepUnderForce(const MatrixX& J, Integrator integrator,
                       const std::function<double(double)>& activation) {
  const MatrixX Z = J.topLeftCorner(4, 4) * kStep, one = MatrixX::Identity(4, 4);
  const VectorX b = J.col(4).head(4) * kStep;
  if (integrator == Integrator::kEuler) return SolveSquare(one - Z, MatrixX(b * activation(1))).col(0);
  const double gamma = 1 - std::sqrt(0.5);
  const MatrixX k1 = SolveSquare(one - gamma * Z, MatrixX(b * activation(gamma))),
                k2 = SolveSquare(one - gamma * Z, MatrixX(b * activation(1) + (1 - gamma) * Z * k1));
  return (1 - gamma) * k1 + gamma * k2;
}

TEST_P(LinearizeCart, LaggedControl_ActivationIsPartOfTheState) {
  CartAndPole cart;
  cart.lag = 0.1;
  Simulation simulation = StartFrom(cart.Make(), GetParam());
  const LinearizedStep step = LinearizeOrThrow(simulation);
  EXPECT_EQ(step.activations, std::vector<std::string>{"drive"});
  ASSERT_EQ(step.A.rows(), 5);
  const auto decay = [&](double share) { return std::exp(-share * kStep / cart.lag); };
  const auto rise = [&](double share) { return 1 - decay(share); };
  EXPECT_NEAR(step.A(4, 4), decay(1), 1e-9);
  EXPECT_NEAR(step.B(4, 0), rise(1), 1e-9);
  EXPECT_EQ(step.A.row(4).head(4).norm(), 0);
  const Vector4 units(1, 1, kStep, kStep);  // and the tolerance as above
  const auto error = [&](const VectorX& column, const std::function<double(double)>& activation) {
    const Vector4 expected = StepUnderForce(cart.Jacobian(), GetParam(), activation);
    return units.cwiseProduct(column.head(4) - expected).cwiseAbs().maxCoeff();
  };
  EXPECT_LT(error(step.A.col(4), decay), 3e-7);
  EXPECT_LT(error(step.B.col(0), rise), 3e-7);
  simulation.SetControl("drive", 0.5);
  simulation.Step();
  EXPECT_NEAR(step.Deviation(simulation)(4), 0.5 * rise(1), 1e-12);
}

// A control that moves within the step: by its value where it starts and where it ends.
TEST_P(LinearizeCart, MovingControl_StartAndEndActByTheirShares) {
  const CartAndPole cart;
  Simulation simulation = StartFrom(cart.Make(), GetParam());
  LinearizeOptions options;
  options.controls_move = options.start_controls = true;
  const LinearizedStep step = LinearizeOrThrow(simulation, options);
  const Vector4 units(1, 1, kStep, kStep);
  const auto error = [&](const MatrixX& column, const std::function<double(double)>& activation) {
    const Vector4 expected = StepUnderForce(cart.Jacobian(), GetParam(), activation);
    return units.cwiseProduct(column.col(0) - expected).cwiseAbs().maxCoeff();
  };
  EXPECT_LT(error(step.B, [](double share) { return share; }), 3e-7);
  EXPECT_LT(error(step.B_start, [](double share) { return 1 - share; }), 3e-7);
  EXPECT_LT(step.difference, 1e-6);
  options.inputs = std::vector<int>{};
  EXPECT_EQ(LinearizeOrThrow(simulation, options).B.cols(), 0);
}

// Of random mechanisms and free bodies in motion: what a keyframe beside the state leads to.
TEST(Linearize, RandomMechanismsInMotion_StepsFromKeyframesBeside) {
  for (unsigned seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE(seed);
    RandomSource random(seed);
    testing::RandomMechanismOptions drawn;
    drawn.bodies = 4;
    drawn.hinges_only = seed % 2 == 0;
    drawn.interfaces = 4;
    drawn.controls = 2;
    drawn.base = seed % 3 == 0 ? BaseKind::kFloating : BaseKind::kFixed;
    Scene scene = SceneOf(testing::RandomMechanismDef(seed, drawn));
    FreeBodyDef stone;
    stone.name = "stone";
    stone.inertia = random.Inertia();
    stone.X_WB = RigidTransform(Vector3(5, 0, 0));
    scene.free_bodies.push_back(stone);
    Simulation at = StartFrom(scene);
    KeyframeDef key = at.State();
    key.mechanisms[0].q += random.Vector(static_cast<int>(key.mechanisms[0].q.size()), 0.2);
    key.mechanisms[0].q_dot = random.Vector(static_cast<int>(key.mechanisms[0].q.size()), 1);
    if (drawn.base == BaseKind::kFloating) key.mechanisms[0].V_R = random.Six(1);
    key.free_bodies[0].omega_W = random.InBox(3);
    key.free_bodies[0].velocity_W = random.InBox(1);
    const auto start = [&](const KeyframeDef& from) {
      Scene with = scene;
      with.keyframes.push_back(from);
      SimulationOptions options;
      options.dt = kStep;
      options.initial_keyframe = 0;
      auto out = Simulation::Create(with, options);
      if (!out) throw std::runtime_error(out.error().Text());
      out->step_options().refresh = false;
      out->step_options().newton_tolerance = kToRounding;
      return std::move(*out);
    };
    Simulation simulation = start(key);
    const LinearizedStep step = LinearizeOrThrow(simulation);
    const auto n = static_cast<Eigen::Index>(step.coordinates.size());
    ASSERT_EQ(n, key.mechanisms[0].q.size() + (drawn.base == BaseKind::kFloating ? 12 : 6));
    // Central differences along a direction of all coordinates and rates, by new simulations.
    constexpr double kChange = 1e-4;
    const VectorX dq = random.Vector(static_cast<int>(key.mechanisms[0].q.size()), 1),
                  dq_dot = random.Vector(static_cast<int>(dq.size()), 10);
    const Vector3 turn = random.InBox(1), spin = random.InBox(10);
    VectorX next[2], dx;
    for (const int side : {0, 1}) {
      const double by = side == 0 ? kChange : -kChange;
      KeyframeDef moved = key;
      moved.mechanisms[0].q += by * dq;
      moved.mechanisms[0].q_dot += by * dq_dot;
      moved.free_bodies[0].X_WB =
          RigidTransform(Matrix3(ExpRotation(by * turn) * key.free_bodies[0].X_WB.rotation()),
                         key.free_bodies[0].X_WB.translation());
      moved.free_bodies[0].omega_W += by * spin;
      Simulation beside = start(moved);
      const VectorX moved_by = step.Deviation(beside) / by;
      if (side == 0)
        dx = moved_by;
      else
        EXPECT_LT((dx - moved_by).cwiseAbs().maxCoeff(), 1e-9) << "the change is not linear";
      EXPECT_NEAR((moved_by.head(dq.size()) - dq).norm(), 0, 1e-9);
      ASSERT_TRUE(beside.Step().stages_converged);
      next[side] = step.Deviation(beside);
    }
    const VectorX expected = (next[0] - next[1]) / (2 * kChange);
    EXPECT_LT((step.A * dx - expected).norm(), 2e-6 * expected.norm());
    EXPECT_TRUE(step.switches.empty());
  }
}

// One freedom, told by one of three hinges: the step from a state beside it.
TEST(Linearize, FourBar_OneCoordinateTellsAllJoints) {
  Scene scene = SceneOf(testing::FourBar{}.Definition());
  scene.gravity = Vector3(2, -9.81, 0);
  Simulation simulation = StartFrom(scene);
  for (int i = 0; i < 5; ++i) simulation.Step();
  LinearizeOptions options;
  options.outputs = {simulation.FindBody("coupler")};
  const LinearizedStep step = LinearizeOrThrow(simulation, options);
  ASSERT_EQ(step.coordinates.size(), 1u);
  ASSERT_EQ(step.A.rows(), 2);
  EXPECT_LT(step.difference, 1e-6);
  // The twist of the coupler per rate of the coordinate is what the simulation moves by.
  const Vector6 V = simulation.Velocity(options.outputs[0]);
  const VectorX q_dot = simulation.State().mechanisms[0].q_dot;
  const std::vector<std::string> names = simulation.CoordinateNames();
  const auto joint = std::find(names.begin(), names.end(), step.coordinates[0]) - names.begin();
  EXPECT_LT((step.C.col(0) * q_dot(joint) - V).norm(), 1e-6 * V.norm());
  EXPECT_EQ(step.C.col(1).norm(), 0);
  // Two steps on, the difference of two motions has gone by A each step, whose own change is of the order of a step.
  Simulation::Snapshot start = simulation.Save();
  Simulation::Snapshot pushed = start;
  pushed.world.mechanisms[0].reduced.w *= 1 + 1e-5;
  VectorX dx[2], x[2];
  for (const int side : {0, 1}) {
    ASSERT_TRUE(simulation.Restore(side == 0 ? start : pushed));
    simulation.step_options().newton_tolerance = kToRounding;
    dx[side] = step.Deviation(simulation);
    simulation.Step();
    x[side] = step.Deviation(simulation);
  }
  const VectorX moved = dx[1] - dx[0];
  EXPECT_GT(moved.norm(), 0);
  EXPECT_LT((x[1] - x[0] - step.A * moved).norm(), 1e-4 * moved.norm());
}

Scene BoxOnPlane(double friction) {
  Scene scene;
  scene.name = "box";
  FreeBodyDef box;
  box.name = "box";
  box.inertia = testing::Brick(2, Vector3(0.05, 0.05, 0.05));
  box.X_WB = RigidTransform(Vector3(0, 0, 0.05));
  GeometryDef shape;
  shape.name = "box_shape";
  shape.shape = Box{Vector3(0.05, 0.05, 0.05)};
  shape.friction = friction;
  box.geometries.push_back(shape);
  scene.free_bodies.push_back(box);
  GeometryDef plane;
  plane.name = "plane";
  plane.shape = Plane{};
  plane.friction = friction;
  scene.world.push_back(plane);
  return scene;
}

// What sticks keeps its place and loses its speed within a step, as one does that starts with that speed; without
// friction speed stays, and moves.
TEST(Linearize, BoxOnAPlane_SticksOrSlides) {
  for (const double friction : {0.8, 0.0}) {
    SCOPED_TRACE(friction);
    Simulation simulation = StartFrom(BoxOnPlane(friction));
    for (int i = 0; i < 120; ++i) simulation.Step();
    const LinearizedStep step = LinearizeOrThrow(simulation);
    ASSERT_EQ(step.coordinates[3], "box.x");
    const auto at = [&](int row, int column) { return step.A(row, column); };
    Simulation::Snapshot pushed = simulation.Save();
    constexpr double kSpeed = 1e-3;
    pushed.world.free_bodies[0].velocity.x() += kSpeed;
    ASSERT_TRUE(simulation.Restore(pushed));
    simulation.step_options().newton_tolerance = kToRounding;
    simulation.Step();
    const VectorX next = step.Deviation(simulation) / kSpeed;
    for (const int i : {3, 4}) {  // x, y
      // The contact's material gives, and gives back.
      EXPECT_NEAR(at(6 + i, 6 + i), friction > 0 ? 0 : 1, friction > 0 ? 0.05 : 1e-6);
      EXPECT_NEAR(at(6 + i, 6 + i), next(9), 1e-5);
      EXPECT_NEAR(at(i, 6 + i), next(3), 1e-5 * kStep);
      EXPECT_NEAR(at(i, i), 1, 1e-6);
      EXPECT_NEAR(at(6 + i, i), 0, 1e-6 / kStep);
    }
    EXPECT_LT(step.c.cwiseAbs().maxCoeff(), 1e-8);
  }
}

// A box that floats over a plane, whose length is 0.07 m. Changes of 1e-6 one by one lower no corner by more than 0.07 um,
// all together one of them by 0.3 um: between the two no column has a switch, and the check along them all tells.
TEST(Linearize, PlaneThatOnlyAllChangesTogetherReach_IsInTheDifference) {
  const auto over_plane = [](double gap) {
    Scene scene = BoxOnPlane(0.5);
    scene.gravity.setZero();
    scene.free_bodies[0].X_WB.translation().z() += gap;
    Simulation simulation = StartFrom(scene);
    return LinearizeOrThrow(simulation);
  };
  EXPECT_TRUE(std::isnan(over_plane(0.05e-6).difference));
  EXPECT_FALSE(over_plane(0.05e-6).switches.empty());
  EXPECT_TRUE(over_plane(0.15e-6).switches.empty());
  EXPECT_GT(over_plane(0.15e-6).difference, 0.05);
  EXPECT_TRUE(over_plane(0.5e-6).switches.empty());
  EXPECT_LT(over_plane(0.5e-6).difference, 1e-6);
}

// A box that floats against a plane goes one way and not the other.
TEST(Linearize, BoxAgainstAPlane_IsNamed) {
  Scene scene = BoxOnPlane(0.5);
  scene.gravity.setZero();
  Simulation simulation = StartFrom(scene);
  const LinearizedStep step = LinearizeOrThrow(simulation);
  std::vector<std::string> names;
  for (const auto& s : step.switches) names.push_back(s.of);
  EXPECT_NE(std::find(names.begin(), names.end(), "rate of box.z"), names.end())
      << ::testing::PrintToString(names);
  EXPECT_EQ(std::find(names.begin(), names.end(), "rate of box.x"), names.end())
      << ::testing::PrintToString(names);
  for (const auto& s : step.switches)
    if (s.of == "rate of box.z") {
      EXPECT_NE(s.change.find("contacts that bear"), std::string::npos) << s.change;
    }
}

// A finger held by a servo of 500 N/m, with dry friction of 1 N: set-points up to 2 mm off do not move it, and where they
// are just beyond that one side of the step does.
TEST(Linearize, JointHeldByDryFriction_IsNamed) {
  Scene scene = Gripper().Make();
  scene.free_bodies.clear();
  scene.gravity.setZero();
  MechanismDef& gripper = scene.mechanisms[0];
  gripper.frictions.push_back({"left_grip", {{FreedomRef{gripper.FindJoint("left_grip"), 0}, 1.0}}, 1, {}});
  for (const double share : {0.5, 1 - 1e-5, 1 + 1e-5}) {
    Simulation simulation = StartFrom(scene);
    simulation.SetControl("left", share * 0.002);
    const LinearizedStep step = LinearizeOrThrow(simulation);
    EXPECT_EQ(step.stuck.size(), share < 1 ? 1u : 0u) << share;
    if (share < 1) {
      EXPECT_EQ(step.stuck[0], "left_grip");
    }
    EXPECT_EQ(step.switches.empty(), share < 0.9) << share;
    for (const auto& s : step.switches)
      EXPECT_NE(s.change.find("dry friction holds"), std::string::npos) << s.of << ": " << s.change;
    if (share < 0.9) {
      EXPECT_NEAR(step.B(1, 0), 0, 1e-9);  // 1 where it moves, within rounding of differences
    }
  }
}

TEST(Linearize, HeldBall_InputsMoveIt) {
  const Gripper given;
  Simulation simulation = given.Start();
  testing::Squeeze(simulation, 0.01);
  testing::Steps(simulation, 240);
  const LinearizedStep step = LinearizeOrThrow(simulation);
  EXPECT_TRUE(step.switches.empty()) << step.switches[0].of << ": " << step.switches[0].change;
  // Both set-points by the same amount to the same side: the ball goes with the fingers.
  Simulation::Snapshot start = simulation.Save();
  VectorX x[2];
  constexpr double kChange = 1e-4;
  for (const int side : {0, 1}) {
    ASSERT_TRUE(simulation.Restore(start));
    simulation.step_options().newton_tolerance = kToRounding;
    for (int i = 0; i < 2; ++i)
      simulation.SetControl(i, start.controls(i) + (i == 0 ? 1 : -1) * (side == 0 ? kChange : -kChange));
    simulation.Step(false);
    x[side] = step.Deviation(simulation);
  }
  const VectorX expected = (x[0] - x[1]) / (2 * kChange), found = step.B.col(0) - step.B.col(1);
  EXPECT_GT(expected.norm(), 0.1);
  EXPECT_LT((found - expected).norm(), 1e-5 * expected.norm());
}

// Of the next step of a run, which the simulation then takes.
LinearizedStep LinearizeToNext(Simulation& simulation, LinearizeOptions options) {
  const Simulation::Snapshot start = simulation.Save();
  simulation.Step();
  options.end = simulation.Save();
  EXPECT_TRUE(simulation.Restore(start));
  LinearizedStep out = LinearizeOrThrow(simulation, options);
  EXPECT_TRUE(simulation.Restore(*options.end));
  return out;
}

double GripForce(Simulation& simulation) {
  double sum = 0;
  for (const ContactRecord& c : simulation.world().contacts()) sum += c.impulse(0) / simulation.dt();
  return sum;
}

// A run's matrices chain, with the forces that its contacts remember: the last force of the grip by one set-point held
// throughout, and where the ball ends.
TEST(Linearize, RunOfAHeldBall_DerivativesChain) {
  const Gripper given;
  Simulation simulation = given.Start();
  testing::Squeeze(simulation, 0.01);
  testing::Steps(simulation, 30);
  constexpr int kSteps = 12;
  const Simulation::Snapshot start = simulation.Save();
  LinearizeOptions options;
  options.friction_forces = true;
  options.inputs = std::vector<int>{0};
  options.outcome = [](Simulation& s) { return VectorX::Constant(1, GripForce(s)); };
  VectorX dx;
  double force = 0;
  LinearizedStep end;
  for (int k = 0; k < kSteps; ++k) {
    const LinearizedStep step = LinearizeToNext(simulation, options);
    ASSERT_TRUE(step.switches.empty()) << step.switches[0].of << ": " << step.switches[0].change;
    EXPECT_LT(step.c.norm(), 1e-6);
    ASSERT_GE(step.forces.size(), 6u);  // of two contacts or more
    EXPECT_EQ(step.A.cols(), 2 * static_cast<Eigen::Index>(step.coordinates.size()) +
                                 static_cast<Eigen::Index>(step.forces.size()));
    if (k == 0) dx = VectorX::Zero(step.A.cols());
    force = step.outcome_A.row(0).dot(dx) + step.outcome_B(0, 0);
    dx = VectorX(step.A * dx + step.B.col(0));
    EXPECT_NEAR(step.outcome(0), 10, 2) << "N";  // two fingers at 500 N/m by 0.01 m
  }
  end = LinearizeOrThrow(simulation);
  constexpr double kChange = 1e-6;
  VectorX x[2];
  double forces[2];
  simulation.step_options().newton_tolerance = kToRounding;
  for (const int side : {0, 1}) {
    ASSERT_TRUE(simulation.Restore(start));
    simulation.SetControl(0, start.controls(0) + (side == 0 ? kChange : -kChange));
    testing::Steps(simulation, kSteps);
    x[side] = end.Deviation(simulation);
    forces[side] = GripForce(simulation);
  }
  const VectorX expected = (x[0] - x[1]) / (2 * kChange);
  EXPECT_GT(expected.norm(), 0.1);
  // Rounding leaves 1e-15 of lengths of 0.02 m, in rates over a stage of 5 ms 1e-7 of the changes.
  constexpr double kTolerance = 1e-6;
  EXPECT_LT((dx.head(expected.size()) - expected).norm(), kTolerance * expected.norm());
  EXPECT_NEAR(force, (forces[0] - forces[1]) / (2 * kChange), kTolerance * given.k);
}

// Loops of a millimetre to a hundred metres are closed to rounding, and not asked for more.
TEST(Linearize, LoopsOfAnySize_AreClosedToRounding) {
  for (const double scale : {0.01, 1.0, 1000.0}) {
    SCOPED_TRACE(scale);
    testing::FourBar bars;
    for (Vector2* point : {&bars.A, &bars.B, &bars.C, &bars.D}) *point *= scale;
    bars.k_A *= scale * scale;  // bars keep their mass
    bars.k_D *= scale * scale;
    Scene scene = SceneOf(bars.Definition());
    scene.gravity = scale * Vector3(2, -9.81, 0);
    Simulation simulation = StartFrom(scene);
    for (int i = 0; i < 5; ++i) simulation.Step();
    EXPECT_LT(LinearizeOrThrow(simulation).difference, 1e-6);
    simulation.step_options().newton_tolerance = kToRounding;
    for (int i = 0; i < 5; ++i) {
      simulation.Step();
      const MechanismDynamics& m = simulation.world().mechanisms()[0];
      EXPECT_LT(m.configuration().loop_residual, ClosedToRounding(m.mechanism()));
      EXPECT_LT(m.configuration().corrections, 6);
    }
    simulation.step_options().newton_tolerance = StepOptions{}.newton_tolerance;
    simulation.Step();
    EXPECT_LT(simulation.world().mechanisms()[0].configuration().loop_residual, kClosingTolerance);
  }
}

TEST(Linearize, LoopThatSwings_DerivativesChain) {
  testing::FourBar soft;
  soft.k_A = soft.k_D = 0.3;
  Scene scene = SceneOf(soft.Definition());
  scene.gravity = Vector3(2, -9.81, 0);
  Simulation simulation = StartFrom(scene);
  const Simulation::Snapshot start = simulation.Save();
  constexpr int kSteps = 20;
  LinearizeOptions options;
  MatrixX by_start = MatrixX::Identity(2, 2);
  const LinearizedStep first = LinearizeOrThrow(simulation);
  for (int k = 0; k < kSteps; ++k) {
    by_start = LinearizeToNext(simulation, options).A * by_start;
  }
  const LinearizedStep end = LinearizeOrThrow(simulation);
  constexpr double kChange = 1e-5;
  VectorX from[2], to[2];
  simulation.step_options().newton_tolerance = kToRounding;
  for (const int side : {0, 1}) {
    Simulation::Snapshot moved = start;
    moved.world.mechanisms[0].reduced.w.array() += side == 0 ? kChange : -kChange;
    ASSERT_TRUE(simulation.Restore(moved));
    from[side] = first.Deviation(simulation);
    testing::Steps(simulation, kSteps);
    to[side] = end.Deviation(simulation);
  }
  const VectorX expected = to[0] - to[1], found = by_start * (from[0] - from[1]);
  EXPECT_GT(expected.norm(), 1e-6);
  // Rounding leaves 1e-14 of a joint, 1e-8 of the changes.
  EXPECT_LT((found - expected).norm(), 1e-6 * expected.norm()) << found << "\n\n" << expected;
}

// What an outcome throws comes through, and leaves the simulation as it was.
TEST(Linearize, OutcomeThatThrows_SimulationIsPutBack) {
  Simulation simulation = StartFrom(CartAndPole{}.Make());
  const std::uint64_t before = simulation.HashState();
  int calls = 0;
  LinearizeOptions options;
  options.outcome = [&](Simulation&) -> VectorX {
    if (++calls == 3) throw std::runtime_error("no more");
    return VectorX::Zero(1);
  };
  EXPECT_THROW(static_cast<void>(Linearize(simulation, options)), std::runtime_error);
  EXPECT_EQ(simulation.HashState(), before);
  EXPECT_EQ(simulation.step_options().newton_tolerance, StepOptions{}.newton_tolerance);
  EXPECT_TRUE(simulation.step_options().refresh);
  calls = 0;
  options.outcome = [&](Simulation&) { return VectorX(VectorX::Zero(++calls)); };
  EXPECT_THROW(static_cast<void>(Linearize(simulation, options)), std::invalid_argument);
}

TEST(Linearize, BadOptions_AreTold) {
  Simulation simulation = StartFrom(CartAndPole{}.Make());
  LinearizeOptions options;
  options.change = 0;
  auto out = Linearize(simulation, options);
  ASSERT_FALSE(out);
  EXPECT_NE(out.error().Text().find("change = 0"), std::string::npos) << out.error().Text();
  options = {};
  options.outputs = {17};
  out = Linearize(simulation, options);
  ASSERT_FALSE(out);
  EXPECT_NE(out.error().Text().find("no body 17"), std::string::npos) << out.error().Text();
  options = {};
  options.inputs = std::vector<int>{3};
  out = Linearize(simulation, options);
  ASSERT_FALSE(out);
  EXPECT_NE(out.error().Text().find("no control 3"), std::string::npos) << out.error().Text();
  const LinearizedStep step = LinearizeOrThrow(simulation);
  const Simulation other = StartFrom(BoxOnPlane(0.5));
  EXPECT_FALSE(step.IsOf(other));
  EXPECT_THROW(step.Deviation(other), std::invalid_argument);
}

}  // namespace
}  // namespace fork1s
