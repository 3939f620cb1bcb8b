// World::StepInParts: steps of a share of the length, with the inputs that a step has within it.
#include <gtest/gtest.h>

#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <fork1s/world/world_state.hpp>
#include <mechanisms.hpp>

namespace fork1s {
namespace {

constexpr double kWholeStep = 1.0 / 64, kPull = 3;  // s, N; a length whose parts have no rounding

// A stone that falls and a pendulum with a servo, apart.
Scene StoneAndPendulum() {
  MechanismBuilder builder("pendulum");
  BodyDef body;
  body.name = "bob";
  body.parent = builder.base();
  body.inertia = testing::Rod(0.5, 0.3);
  const JointIndex hinge =
      builder.AddJoint(JointDef::Hinge("hinge", builder.AddBody(body), Vector3::UnitY()).WithSpring(5, 0.02));
  ControlDef control;
  control.name = "set";
  control.terms.emplace_back(FreedomRef{hinge, 0}, 1.0);
  control.gain = 5;
  control.is_setpoint = true;
  builder.AddControl(control);
  builder.SetInterfaces({"bob"});
  Scene scene;
  scene.mechanisms.push_back(builder.definition());
  FreeBodyDef stone;
  stone.name = "stone";
  stone.inertia = testing::Brick(1, Vector3(0.1, 0.2, 0.3));
  stone.X_WB = RigidTransform(Vector3(5, 0, 0));
  scene.free_bodies.push_back(stone);
  return scene;
}

Simulation MustCreate(double dt) {
  SimulationOptions options;
  options.dt = dt;
  auto made = Simulation::Create(StoneAndPendulum(), options);
  if (!made) throw std::runtime_error(made.error().Text());
  return std::move(*made);
}

// The same path by a simulation of a quarter of the step that is told where the control is at each quarter.
TEST(StepInParts, OfControlsThatMoveOrAreHeldIsWhatAFinerSimulationDoes) {
  for (const bool moves : {true, false}) {
    Simulation whole = MustCreate(kWholeStep), parts = MustCreate(kWholeStep),
               fine = MustCreate(kWholeStep / 4);
    double before = 0;
    for (int i = 1; i <= 40; ++i) {
      const double set = 0.3 * i / 16.0;
      whole.SetControl("set", set);
      whole.ApplyWrench(whole.FindBody("stone"), Vector3(kPull, 0, 0), Vector3::Zero(),
                        whole.Pose("stone").translation());
      ASSERT_TRUE(whole.Step(moves).finite);
      StepOptions options = whole.step_options();
      const StepReport report = parts.world().StepInParts(whole.world().StartOfLastStep(), options, 4);
      ASSERT_TRUE(report.finite);
      EXPECT_EQ(report.parts, 4);
      for (int k = 1; k <= 4; ++k) {
        fine.SetControl("set", moves ? before + k / 4.0 * (set - before) : set);
        fine.ApplyWrench(fine.FindBody("stone"), Vector3(kPull, 0, 0), Vector3::Zero(),
                         fine.Pose("stone").translation());
        ASSERT_TRUE(fine.Step(moves).finite);
      }
      before = set;
      // To rounding: shares of a control are taken in another order.
      EXPECT_NEAR(parts.JointCoordinates(0)(0), fine.JointCoordinates(0)(0), 1e-13) << i;
      EXPECT_LT((parts.Pose("stone").translation() - fine.Pose("stone").translation()).norm(), 1e-13) << i;
    }
    // The force and the weight on the stone, both constant, which no step errs in.
    const double t = whole.time();
    EXPECT_NEAR(parts.Pose("stone").translation().x(), 5 + 0.5 * kPull * t * t, 1e-12);
    EXPECT_GT(std::abs(parts.JointCoordinates(0)(0) - whole.JointCoordinates(0)(0)), 1e-7);
  }
}

TEST(StepInParts, RefusesInputsOfAnotherWorldAndBeforeTheFirstStep) {
  Simulation here = MustCreate(kWholeStep);
  EXPECT_THROW(here.world().StartOfLastStep(), std::invalid_argument);
  ASSERT_TRUE(here.Step().finite);
  Scene alone = StoneAndPendulum();
  alone.free_bodies.clear();
  auto other = Simulation::Create(alone);
  ASSERT_TRUE(other);
  EXPECT_THROW(other->world().StepInParts(here.world().StartOfLastStep(), other->step_options(), 2),
               std::invalid_argument);
  EXPECT_THROW(here.world().StepInParts(here.world().StartOfLastStep(), here.step_options(), 0),
               std::invalid_argument);
}

}  // namespace
}  // namespace fork1s
