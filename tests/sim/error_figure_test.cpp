// The error figure of a run: moments to come back to, and what it says where there is no estimate.
#include "sim/error_figure.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "gripper.hpp"
#include "mechanisms.hpp"

namespace fork1s {
namespace {

using internal::ErrorFigure;

void StepBoth(Simulation& simulation, ErrorFigure& figure, int steps) {
  for (int i = 0; i < steps; ++i) {
    simulation.SetControl(0, 0.004 * std::sin(0.3 * static_cast<double>(simulation.steps() + 1)));
    figure.BeginStep(simulation);
    figure.EndStep(simulation, simulation.Step(true));
  }
}

void ExpectEqual(const ErrorFigure& a, const ErrorFigure& b) {
  ASSERT_EQ(a.bodies().size(), b.bodies().size());
  for (std::size_t i = 0; i < a.bodies().size(); ++i) {
    const ErrorFigure::Body &one = a.bodies()[i], &other = b.bodies()[i];
    EXPECT_EQ(one.name, other.name);
    EXPECT_EQ(one.total, other.total) << one.name;
    EXPECT_EQ(one.interior, other.interior) << one.name;
    EXPECT_EQ(one.time, other.time) << one.name;
    EXPECT_EQ(one.last, other.last) << one.name;
    EXPECT_EQ(one.motion, other.motion) << one.name;
    EXPECT_EQ(one.angle, other.angle) << one.name;
    EXPECT_EQ(one.angle_last, other.angle_last) << one.name;
  }
  EXPECT_EQ(a.Warnings(), b.Warnings());
}

Simulation GripperInMotion() {
  auto simulation = Simulation::Create(testing::Gripper{}.Make());
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

TEST(ErrorFigure, RestoredMomentGoesOnWithTheSameNumbers) {
  Simulation simulation = GripperInMotion();
  ErrorFigure figure;
  StepBoth(simulation, figure, 10);
  const Simulation::Snapshot moment = simulation.Save();
  const ErrorFigure::Snapshot errors = figure.Save();
  StepBoth(simulation, figure, 20);
  ASSERT_GT(figure.largest().total, 0);
  // The same simulation, and one that has not been stepped.
  ErrorFigure again, fresh;
  ASSERT_TRUE(simulation.Restore(moment));
  again.Restore(simulation, errors);
  StepBoth(simulation, again, 20);
  ExpectEqual(again, figure);
  Simulation other = GripperInMotion();
  ASSERT_TRUE(other.Restore(moment));
  fresh.Restore(other, errors);
  StepBoth(other, fresh, 20);
  ExpectEqual(fresh, figure);
}

// A body that a constant moment turns in place, by α t²/2. Backward Euler turns it α h² n (n + 1)/2 in n steps, α h t/2 too
// far; steps of h/4 err by a quarter of that, so the extrapolation is exact. Its origin does not move at all.
TEST(ErrorFigure, BodyThatTurnsInPlaceHasAnErrorOfAngle) {
  constexpr double kInertia = 0.02, kAcceleration = 2;  // kg m², rad/s²
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    Scene scene;
    scene.gravity.setZero();
    FreeBodyDef wheel;
    wheel.name = "wheel";
    wheel.inertia.mass = 1;
    wheel.inertia.rotational = kInertia * Matrix3::Identity();
    scene.free_bodies.push_back(wheel);
    SimulationOptions options;
    options.dt = 1.0 / 60;
    options.step.integrator = integrator;
    auto simulation = Simulation::Create(scene, options);
    ASSERT_TRUE(simulation) << simulation.error().Text();
    ErrorFigure figure;
    for (int i = 0; i < 30; ++i) {
      simulation->ApplyWrench(0, Vector3::Zero(), Vector3(0, 0, kInertia * kAcceleration), Vector3::Zero());
      figure.BeginStep(*simulation);
      figure.EndStep(*simulation, simulation->Step());
    }
    const double t = simulation->time(), truth = kAcceleration * t * t / 2;
    const double off = LogRotation(simulation->Pose(0).rotation()).z() - truth;
    ASSERT_EQ(figure.bodies().size(), 1u);
    const ErrorFigure::Body& told = figure.bodies()[0];
    if (integrator == Integrator::kEuler) {
      EXPECT_NEAR(off, kAcceleration * options.dt * t / 2, 1e-12);
    }
    EXPECT_NEAR(told.angle, std::abs(off), 1e-12);  // rounding of angles of 1/4
    EXPECT_NEAR(told.angle_last, std::abs(off), 1e-12);
    EXPECT_NEAR(told.total, 0, 1e-15);
    EXPECT_EQ(figure.largest().angle, told.angle);
  }
}

TEST(ErrorFigure, WayIsNoneWithinADigitOfPositions) {
  const Vector3 from(3, 0, 4), to = from;  // 5 m from the origin, both
  for (const double way : {0.99e-12, 1.01e-12})
    EXPECT_EQ(internal::WayBeyondRounding(from, to + Vector3(0, way, 0)).isZero(0), way < 1e-12) << way;
}

// A pendulum whose origin lies on its hinge, away from the world's: it moves by rounding, of which nothing is a share.
TEST(ErrorFigure, BodyThatTurnsAboutItsOriginHasNoMotion) {
  MechanismBuilder builder("pendulum");
  BodyDef bob;
  bob.name = "bob";
  bob.parent = builder.base();
  bob.X_PB = RigidTransform(Vector3(0.7, 0, 1));
  bob.inertia.mass = 0.1;
  bob.inertia.center = Vector3(0.1, 0, -0.4);
  bob.inertia.rotational = Vector3::Constant(1e-5).asDiagonal();
  builder.AddJoint(JointDef::Hinge("hinge", builder.AddBody(bob), Vector3::UnitY()));
  builder.SetInterfaces({"bob"});
  Scene scene;
  scene.mechanisms.push_back(builder.definition());
  auto simulation = Simulation::Create(scene);
  ASSERT_TRUE(simulation) << simulation.error().Text();
  ErrorFigure figure;
  for (int i = 0; i < 60; ++i) {
    figure.BeginStep(*simulation);
    figure.EndStep(*simulation, simulation->Step());
  }
  EXPECT_EQ(figure.largest().motion, 0);
  EXPECT_EQ(figure.largest().total, 0);
  EXPECT_GT(figure.largest().angle, 1e-5);
  EXPECT_TRUE(figure.Warnings().empty()) << ::testing::PrintToString(figure.Warnings());
}

TEST(ErrorFigure, MomentBeforeTheFirstStepIsTheBeginning) {
  Simulation simulation = GripperInMotion();
  ErrorFigure figure;
  const Simulation::Snapshot moment = simulation.Save();
  const ErrorFigure::Snapshot errors = figure.Save();
  StepBoth(simulation, figure, 10);
  ErrorFigure again = ErrorFigure();
  ASSERT_TRUE(simulation.Restore(moment));
  again.Restore(simulation, errors);
  EXPECT_TRUE(again.bodies().empty());
  StepBoth(simulation, again, 10);
  ExpectEqual(again, figure);
}

TEST(ErrorFigure, BegunAnewKeepsTheLargestErrorsAndSaysSo) {
  Simulation simulation = GripperInMotion();
  ErrorFigure figure;
  StepBoth(simulation, figure, 10);
  const double before = figure.largest().total;
  figure.Restart("here");
  figure.Restart("there");  // no estimate ended
  EXPECT_EQ(figure.largest().total, before);
  EXPECT_EQ(figure.Warnings().back(), "the error estimate began again here");
  StepBoth(simulation, figure, 1);
  EXPECT_GE(figure.largest().total, before);
}

// Steps beside the simulation go on under a gravity that leaves no finite velocity, and are undone.
TEST(ErrorFigure, IsNotQuantifiedWhereAShorterStepIsUndone) {
  Simulation simulation = GripperInMotion();
  ErrorFigure figure;
  StepBoth(simulation, figure, 5);
  const ErrorFigure::Snapshot before = figure.Save();
  const Simulation::Snapshot moment = simulation.Save();
  figure.BeginStep(simulation);
  const StepReport report = simulation.Step();
  const Vector3 gravity = simulation.step_options().gravity;
  simulation.step_options().gravity = Vector3::Constant(0.1 * std::numeric_limits<double>::max());
  figure.EndStep(simulation, report);
  simulation.step_options().gravity = gravity;
  EXPECT_FALSE(figure.largest().finite);
  EXPECT_FALSE(figure.largest().IsWithinRange());
  EXPECT_TRUE(std::isinf(figure.bodies()[0].last));
  ASSERT_EQ(figure.Warnings().size(), 1u);
  EXPECT_NE(figure.Warnings()[0].find("no error estimate"), std::string::npos) << figure.Warnings()[0];
  ASSERT_TRUE(simulation.Restore(moment));
  figure.Restore(simulation, before);
  StepBoth(simulation, figure, 5);
  EXPECT_TRUE(figure.largest().finite);
}

// A body in space that a sprung tail sways; the tail alone is an interface body.
Simulation Swayed(double dt) {
  MechanismBuilder builder("swayed", BaseKind::kFloating, testing::Brick(1, Vector3(0.1, 0.05, 0.03)));
  BodyDef tail;
  tail.name = "tail";
  tail.parent = builder.base();
  tail.X_PB = RigidTransform(Vector3(0.1, 0, 0));
  tail.inertia = testing::Rod(0.5, 0.3);
  builder.AddJoint(JointDef::Hinge("sway", builder.AddBody(tail), Vector3::UnitZ()).WithSpring(2, 0.01));
  builder.SetInterfaces({"tail"});
  Scene scene;
  scene.gravity.setZero();
  scene.mechanisms.push_back(builder.definition());
  KeyframeDef bent;
  bent.mechanisms.push_back({VectorX::Constant(1, 1), VectorX::Zero(1), {}, Vector6::Zero(), {}});
  scene.keyframes.push_back(bent);
  SimulationOptions options;
  options.dt = dt;
  options.initial_keyframe = 0;
  auto simulation = Simulation::Create(scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

TEST(ErrorFigure, HasTheFloatingBaseBesideTheInterfaceBodies) {
  constexpr int kFrames = 30, kFiner = 16;
  Simulation coarse = Swayed(1.0 / 60), fine = Swayed(1.0 / 60 / kFiner);
  ErrorFigure figure;
  double off = 0;  // m, the largest; the finer run is off by 1/256 of it
  for (int i = 0; i < kFrames; ++i) {
    figure.BeginStep(coarse);
    figure.EndStep(coarse, coarse.Step());
    for (int k = 0; k < kFiner; ++k) fine.Step();
    off = std::max(off, (coarse.BasePose(0).translation() - fine.BasePose(0).translation()).norm());
  }
  ASSERT_EQ(figure.bodies().size(), 2u);
  const ErrorFigure::Body& trunk = figure.bodies()[0];
  EXPECT_EQ(trunk.name, coarse.given_mechanism(0).body(BodyIndex(0)).name);
  EXPECT_GT(trunk.motion, 0.01);
  EXPECT_GT(off, 1e-6);
  // Between half and three times the error, as of all bodies (tests/lab/error_estimate_test.cpp).
  EXPECT_GT(trunk.total, 0.5 * off);
  EXPECT_LT(trunk.total, 3 * off);
}

}  // namespace
}  // namespace fork1s
