#include <gtest/gtest.h>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>

namespace fork1s {
namespace {

TEST(StackedBalls, FewNewtonIterationsAndLittlePenetration) {
  auto imported = LoadMechanism(FORK1S_SOURCE_DIR "/scenes/stacked_balls.xml");
  ASSERT_TRUE(imported.has_value()) << imported.error().Text();
  auto simulation = Simulation::Create(imported->scene);
  ASSERT_TRUE(simulation.has_value()) << simulation.error().Text();
  for (int i = 0; i < 120; ++i) {
    const StepReport report = simulation->Step();
    ASSERT_TRUE(report.finite);
    EXPECT_TRUE(report.IsSolved()) << i;
    EXPECT_LE(report.solver.newton_iterations, 10) << i;
    EXPECT_LT(report.max_penetration, 5e-4) << i;
  }
}

}  // namespace
}  // namespace fork1s
