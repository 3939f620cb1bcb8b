// Which runs count as stable, and which steps are.
#include "study/stability.hpp"
#include "study/stable_runs.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace fork1s::internal {
namespace {

// A body that goes 1 m along x in one second at a steady speed, and does not turn.
Run Steady() {
  Run run;
  run.samples.resize(61);
  for (std::size_t i = 0; i < run.samples.size(); ++i)
    run.samples[i].X_WB.emplace_back(Vector3(static_cast<double>(i) / 60, 0, 0));
  return run;
}

Vector3& Place(Run& run, std::size_t sample) { return run.samples[sample].X_WB[0].translation(); }

TEST(StableRun, MayBeAsFarFromTheReferenceAsItsPathsAreWide) {
  const auto reference = Steady();
  for (const double off : {0.0, 0.99, 1.01}) {
    auto run = Steady();
    for (std::size_t i = 0; i < run.samples.size(); ++i) Place(run, i).y() = off;
    EXPECT_EQ(IsStable(run, reference), off < 1) << off;
  }
}

TEST(StableRun, MayMoveAtThreeTimesTheSpeedAndOneMetrePerSecond) {
  const auto reference = Steady();  // 1/60 m a sample: 4/60 at most
  for (const double jump : {3.9 / 60, 4.1 / 60}) {
    auto run = Steady();
    Place(run, 30).x() = Place(run, 29).x() + jump;
    Place(run, 31).x() = Place(run, 30).x() - 1e-3;
    EXPECT_EQ(IsStable(run, reference), jump < 4.0 / 60) << jump;
  }
}

TEST(StableRun, MayTurnAtThreeTimesTheRateAndThirtyRadiansPerSecond) {
  const auto reference = Steady();  // does not turn: 0.5 rad a sample at most
  for (const double turn : {0.49, 0.51}) {
    auto run = Steady();
    run.samples[30].X_WB[0] = RigidTransform(ExpRotation(Vector3(0, turn, 0)), Place(run, 30));
    EXPECT_EQ(IsStable(run, reference), turn < 0.5) << turn;
  }
}

TEST(StableRun, HasFiniteNumbers) {
  auto run = Steady();
  Place(run, 30).z() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(IsStable(run, Steady()));
}

TEST(FirstStable, HalvesTheStepUntilARunIsStableAndTakesLostRunsForUnstable) {
  const auto found = FirstStable(Steady(), [](int k) -> Expected<internal::Run> {
    if (k == 0) return Fail(ErrorCode::kNumerics, "run", "was lost");
    auto run = Steady();
    run.dt = kLargestStep / (1 << k);
    if (k == 1) Place(run, 60).z() = 2;
    return run;
  });
  ASSERT_TRUE(found && *found);
  EXPECT_DOUBLE_EQ((*found)->dt, kLargestStep / 4);
}

TEST(FirstStable, PassesOtherErrorsOn) {
  const auto found = FirstStable(Steady(), [](int) -> Expected<internal::Run> {
    return Fail(ErrorCode::kModel, "run", "has no control 'a'");
  });
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().code, ErrorCode::kModel);
}

TEST(StableStep, StiffnessLimitsStepsThatTakeSpringsAtTheirStart) {
  // Implicit steps are stable at any stiffness.
  const auto rows = MeasureStability(FORK1S_SOURCE_DIR "/scenes/hexapod.xml", {}, 0.2, {1, 1000});
  ASSERT_TRUE(rows) << rows.error().Text();
  ASSERT_EQ(rows->size(), 8u);
  const auto at = [&](const char* simulator, double scale) {
    for (const StabilityRow& r : *rows)
      if (r.simulator == simulator && r.stiffness_scale == scale) return r.largest_stable_dt_s;
    return -1.0;
  };
  for (const char* simulator : {"fork1s", "fork1s euler"}) {
    EXPECT_DOUBLE_EQ(at(simulator, 1), 1.0 / 60) << simulator;
    EXPECT_DOUBLE_EQ(at(simulator, 1000), 1.0 / 60) << simulator;
  }
  EXPECT_LT(at("MuJoCo implicitfast", 1000), 1.0 / 60);
}

}  // namespace
}  // namespace fork1s::internal
