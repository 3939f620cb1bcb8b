// A hand lifts, shakes and turns over what it holds.
#include <fork1s/diagnostics/load_factor.hpp>

#include "run.hpp"

namespace fork1s::examples {
namespace {

struct GraspCase {
  const char* scene;
  const char* object;
};
std::ostream& operator<<(std::ostream& out, const GraspCase& c) { return out << c.scene; }

class Grasp : public ::testing::TestWithParam<GraspCase> {};

TEST_P(Grasp, HoldsWhatItShakesAndTurnsOver) {
  SceneRun run(GetParam().scene);
  auto in_palm = [&] {
    return Vector3(run.simulation().Pose("palm").inverse() * run.Position(GetParam().object));
  };
  // Drift within a stretch in which the palm stands still: a tenth of the slop of contact.
  auto expect_held = [&](double until, const char* when) {
    const Vector3 before = in_palm();
    const Course course = run.Until(until);
    EXPECT_TRUE(course.finite) << when;
    EXPECT_EQ(course.unconverged, 0) << when;
    EXPECT_LT((in_palm() - before).norm(), 1e-5) << when;
    EXPECT_LT(course.penetration, 2e-4) << when;
  };
  run.Until(3);
  const Vector3 lifted = in_palm();
  const Simulation& simulation = run.simulation();
  const LoadFactor load = ComputeLoadFactor(simulation.world(), simulation.dt());
  EXPECT_GE(load.contacts, 2);
  EXPECT_GT(load.factor, 1.3) << "the margin below which fork1s run warns";
  EXPECT_GT(run.Position(GetParam().object).z(), 0.24) << "lifted by 0.25 m";
  run.Until(5.2);
  // Shaken by 20 mm at 3 Hz, 7 m/s²: the slop of contact on either side of the object.
  EXPECT_LT((in_palm() - lifted).norm(), 2e-4);
  expect_held(5.4, "after shaking");

  run.Until(7.7);
  EXPECT_LT(run.simulation().Pose("palm").rotation()(2, 2), -0.999) << "turned over";
  expect_held(8.4, "upside down");
  run.Until(10.7);
  expect_held(12, "turned back");
  // Contact's slop. Without the curvature of the tangent rows it would be 8 mm: half the step times the
  // radius of 61 mm times the integral of the squared rate, 14 rad²/s over both turns.
  // The mug: 0.13 mm, its weight on twelve points whose slop is used in turn.
  EXPECT_LT((in_palm() - lifted).norm(), GetParam().object == std::string("mug") ? 2e-4 : 1e-4);
}

// By backward Euler contacts move by the velocity of the end of a step, and what is shaken and turned creeps
// by h/2 times the integral of ω² r: 14 rad²/s over both turns and 61 mm are 7 mm.
TEST(GraspByBackwardEuler, CreepsByHalfAStepOfTheTurns) {
  SceneRun run("grasp_sphere");
  run.simulation().step_options().integrator = Integrator::kEuler;
  const auto in_palm = [&] {
    return Vector3(run.simulation().Pose("palm").inverse() * run.Position("ball"));
  };
  run.Until(3);
  const Vector3 lifted = in_palm();
  run.Until(12);
  EXPECT_NEAR((in_palm() - lifted).norm(), 7e-3, 2e-3);
}

// Set-points as they stand at 3 s, the object in the air.
TEST_P(Grasp, HoldsForAMinuteWithoutDrift) {
  SceneRun run(GetParam().scene);
  run.Until(3);
  Simulation& simulation = run.simulation();
  const auto in_palm = [&] {
    return Vector3(simulation.Pose("palm").inverse() * simulation.Pose(GetParam().object).translation());
  };
  const Vector3 before = in_palm();
  double drift = 0;
  while (simulation.time() < 63) {
    ASSERT_TRUE(simulation.Step().finite);
    drift = std::max(drift, (in_palm() - before).norm());
  }
  EXPECT_LT(drift, 1e-4);
}

INSTANTIATE_TEST_SUITE_P(Objects, Grasp,
                         ::testing::Values(GraspCase{"grasp_sphere", "ball"}, GraspCase{"grasp_box", "box"},
                                           GraspCase{"grasp_mug", "mug"}));

}  // namespace
}  // namespace fork1s::examples
