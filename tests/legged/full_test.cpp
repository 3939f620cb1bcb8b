// The first half second of standing, beside the full-coordinate model.
#include <algorithm>
#include <fork1s/study/compare.hpp>

#include "machines.hpp"

namespace fork1s::examples {
namespace {

class Standing : public testing::TestWithParam<Case> {};

TEST_P(Standing, FollowsTheFullModel) {
  if (const std::string why = WhyMissing(GetParam().robot); !why.empty()) GTEST_SKIP() << why;
  const LeggedScene legged = Load(GetParam());
  CompareOptions options;
  options.time = 0.5;
  options.refinements = 0;
  options.integrator = Integrator::kEuler;  // the same rule on both sides: what differs is the reduction's
  const auto comparison = Compare(legged.imported, options);
  ASSERT_TRUE(comparison.has_value()) << comparison.error().Text();
  // Slop of contact. Where a foot first meets a slope it matters more when in the step it does: the full
  // model is as far from itself at half the step (benchmarks/legged), so ANYmal and Digit, which fall
  // deepest, are not held to this on uneven ground.
  int feet = 0;
  for (const BodyDifference& d : comparison->interface) {
    // Cassie's rods are interfaces for their spin only.
    if (std::none_of(legged.feet.begin(), legged.feet.end(), [&](const auto& f) { return f.body == d.body; }))
      continue;
    EXPECT_LT(d.max_mm, 0.15) << d.body;
    ++feet;
  }
  EXPECT_GE(feet, 2);
}

INSTANTIATE_TEST_SUITE_P(Machines, Standing,
                         testing::Values(Case{LeggedRobot::kHexapod}, Case{LeggedRobot::kAnymal},
                                         Case{LeggedRobot::kCassie}, Case{LeggedRobot::kDigit},
                                         Case{LeggedRobot::kHexapod, LeggedGround::kUneven},
                                         Case{LeggedRobot::kCassie, LeggedGround::kUneven}));

}  // namespace
}  // namespace fork1s::examples
