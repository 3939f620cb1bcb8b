// A bunny falls on a trampoline that two men hold: four loops through the trampoline, two through the ground.
#include "run.hpp"

namespace fork1s::examples {
namespace {

constexpr double kBunny = 5.02;  // kg

TEST(Firemen, HoldTheBunny) {
  SceneRun run("firemen");
  Course course = run.Until(0.4);
  EXPECT_EQ(course.force_max, 0) << "still falling";
  double lowest = 10, highest_after = 0;
  course = run.Until(2, [&](const StepReport&) {
    const double z = run.Position("bunny").z();
    lowest = std::min(lowest, z);
    if (z > lowest) highest_after = std::max(highest_after, z);
  });
  EXPECT_TRUE(course.finite);
  EXPECT_EQ(course.unconverged, 0);
  EXPECT_LT(course.gap, 1e-5);          // 0.01 mm; recovery closes loops to 1e-9 m
  EXPECT_LT(course.penetration, 5e-4);  // it lands at 4.2 m/s, 70 mm a step
  EXPECT_GT(highest_after - lowest, 0.15) << "is thrown up again";

  run.Until(11);
  const Vector3 before = run.Position("bunny");
  course = run.Until(12);
  EXPECT_TRUE(course.finite);
  EXPECT_EQ(course.unconverged, 0);
  EXPECT_LT(course.gap, 1e-5);
  // The men sway at 0.5 Hz with little damping: what is left after 11 s moves by less than a millimetre.
  EXPECT_LT((run.Position("bunny") - before).norm(), 1e-3);
  const RigidTransform X_SB = run.simulation().Pose("sheet").inverse() * run.simulation().Pose("bunny");
  EXPECT_LT(std::abs(X_SB.translation().x()), 0.5) << "on the sheet of 1 m by 0.8 m";
  EXPECT_LT(std::abs(X_SB.translation().y()), 0.4);
  EXPECT_GT(X_SB.translation().z(), 0.05);
  // The sway accelerates it by up to 1 % of gravity.
  EXPECT_NEAR(ContactForce(run.simulation(), "bunny").z(), kBunny * 9.81, 0.02 * kBunny * 9.81);
}

// Joint forces of a step whose last part was by an expansion are not known, whichever pose it ends with: at 0.022 s a step
// is halved by a landing in whose last part a joint turns farther than the expansion tells.
TEST(Firemen, ExpandedAtManySteps_NoneIsLost) {
  for (const double dt : {0.01, 1.0 / 60, 0.022, 0.028}) {
    SCOPED_TRACE(dt);
    auto imported = LoadMechanism(FORK1S_SOURCE_DIR "/scenes/firemen.xml");
    ASSERT_TRUE(imported);
    SimulationOptions options;
    options.dt = dt;
    options.recovery = Recovery::kExpanded;
    auto simulation = Simulation::Create(imported->scene, options);
    ASSERT_TRUE(simulation);
    int by_expansion = 0, exact = 0;
    while (simulation->time() < 2) {
      const StepReport report = simulation->Step();
      ASSERT_TRUE(report.finite);
      ++(report.by_expansion > 0 ? by_expansion : exact);
    }
    EXPECT_GT(by_expansion, 10);
    EXPECT_GT(exact, 10);
  }
}

// The modes that ring after start and landing accelerate by more than the load that a column would carry.
TEST(Firemen, LandingAsksForNoLoadColumns) {
  SceneRun run("firemen");
  int refreshes = 0;
  run.Until(3, [&](const StepReport& report) { refreshes += report.refreshes; });
  EXPECT_LE(refreshes, 2);  // of joints that have turned; loads asked for six
}

// Loops stay closed where the springs leave the step nothing to damp: the residual motion of stiff modes is
// what would open them.
TEST(Firemen, LoopsStayClosedStiffAndLightlyDamped) {
  SceneRun run("firemen", 1e3, 1e-3);
  const Course course = run.Until(3);
  EXPECT_TRUE(course.finite);
  EXPECT_LT(course.gap, 1e-5);
  EXPECT_LT(course.penetration, 5e-4);
}

// What so stiff a sheet of so little damping does is throw the bunny off: short steps say so by every rule,
// and steps of second order at 1/60 s too.
TEST(Firemen, AStiffSheetThrowsTheBunnyOff) {
  const Scene scene = SceneRun::Definition("firemen", 1e3, 1e-3);
  for (const auto& [integrator, rate] :
       {std::pair(Integrator::kTwoStage, 60), std::pair(Integrator::kTwoStage, 960),
        std::pair(Integrator::kTwoStage, 60), std::pair(Integrator::kTwoStage, 960),
        std::pair(Integrator::kEuler, 960)}) {
    SimulationOptions options;
    options.dt = 1.0 / rate;
    options.step.integrator = integrator;
    auto simulation = Simulation::Create(scene, options);
    ASSERT_TRUE(simulation) << simulation.error().Text();
    for (int i = 0; i < 3 * rate; ++i) ASSERT_TRUE(simulation->Step().finite);
    EXPECT_LT(simulation->Pose("bunny").translation().z(), 0.3) << rate;
    EXPECT_GT(simulation->Pose("sheet").translation().z(), 1) << rate;
  }
}

}  // namespace
}  // namespace fork1s::examples
