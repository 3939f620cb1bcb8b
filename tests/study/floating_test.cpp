// A floating base whose legs swing: the reduced model comes as near to the full one as the step is short.
#include <gtest/gtest.h>
#include <fork1s/study/compare.hpp>

namespace fork1s {
namespace {

// In free fall, so that nothing but their inertia couples trunk and legs: what the trunk's twist gains as the
// pose changes under it must pull at the joints in the same step.
TEST(FloatingBase, ConvergesToTheFullModelWhileItsLegsSwing) {
  auto imported = LoadMechanism(FORK1S_SOURCE_DIR "/scenes/hexapod.xml");
  ASSERT_TRUE(imported.has_value()) << imported.error().Text();
  imported->scene.gravity.setZero();
  imported->scene.world.clear();
  CompareOptions options;
  options.integrator = Integrator::kEuler;
  options.dt = 1.0 / 240;
  options.time = 0.25;
  options.refinements = 2;
  options.controls.names = {"front_left_yaw", "front_left_hip", "middle_left_hip", "rear_right_yaw",
                            "rear_right_knee"};
  options.controls.times = {0, 10};
  options.controls.rows.assign(2, {0.9, 1.2, 0.8, -0.9, 1.0});
  const auto comparison = Compare(*imported, options);
  ASSERT_TRUE(comparison.has_value()) << comparison.error().Text();
  const auto& steps = comparison->equal_steps;
  ASSERT_EQ(steps.size(), 3u);
  // Both are of first order in the step. The feet move by some 100 mm.
  for (std::size_t i = 1; i < steps.size(); ++i) EXPECT_LT(steps[i].rms_mm, 0.6 * steps[i - 1].rms_mm) << i;
  EXPECT_LT(steps.back().rms_mm, 0.12);
}

}  // namespace
}  // namespace fork1s
