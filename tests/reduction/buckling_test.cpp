// Buckling loads against closed forms.
#include <gtest/gtest.h>

#include <cmath>

#include "mechanisms.hpp"
#include "reduction/buckling.hpp"

namespace fork1s {
namespace {

using testing::Share;

// Rigid links of length l with a spring k at the foot of each, pressed along them: P l / k = 2 - 2 cos((2 i -
// 1) π / (2 n + 1)).
TEST(Buckling, ColumnOfRigidLinks) {
  constexpr double kLength = 0.1, kStiffness = 2;
  for (const int n : {1, 2, 5}) {
    SCOPED_TRACE(n);
    const auto m = Share(testing::Chain(n, kLength, 0.1, kStiffness));
    const auto modes =
        ComputeBucklingModes(*m, VectorX::Zero(n), {{m->FindBody("tip"), Vector3(-1, 0, 0)}}, {}, n);
    ASSERT_TRUE(modes) << modes.error().Text();
    ASSERT_EQ(modes->size(), static_cast<std::size_t>(n));
    for (int i = 1; i <= n; ++i) {
      const double expected = (2 - 2 * std::cos((2 * i - 1) * M_PI / (2 * n + 1))) * kStiffness / kLength;
      EXPECT_NEAR((*modes)[static_cast<std::size_t>(i - 1)].factor, expected, 1e-6 * expected);
    }
    // Angles of the lowest mode against the axis follow a cosine.
    const VectorX angles = [&] {
      VectorX sum = modes->front().q;
      for (int i = 1; i < n; ++i) sum(i) += sum(i - 1);
      return sum;
    }();
    for (int i = 0; i < n; ++i)
      EXPECT_NEAR(angles(i) / angles(n - 1),
                  std::sin((i + 1) * M_PI / (2 * n + 1)) / std::sin(n * M_PI / (2 * n + 1)), 1e-6);
  }
}

// Its own weight takes its part before the load is there.
TEST(Buckling, WeightCountsBeforeTheLoad) {
  const auto m = Share(testing::Chain(1, 0.1, 0.1, 2));
  StaticsOptions options;
  options.gravity_R = Vector3(-10, 0, 0);
  const auto modes =
      ComputeBucklingModes(*m, VectorX::Zero(1), {{m->FindBody("tip"), Vector3(-1, 0, 0)}}, options);
  ASSERT_TRUE(modes) << modes.error().Text();
  EXPECT_NEAR(modes->front().factor, (2 - 0.1 * 10 * 0.05) / 0.1, 1e-6);
  // Tension does not buckle.
  EXPECT_TRUE(
      ComputeBucklingModes(*m, VectorX::Zero(1), {{m->FindBody("tip"), Vector3(1, 0, 0)}}, options)->empty());
}

// A parallelogram of two columns of length l, hinged about z at both ends, with springs k at the feet, under
// a force down on its beam: 2 k φ = P l sin φ.
TEST(Buckling, LoopOfTwoColumns) {
  testing::FourBar frame;
  frame.A = {0, 0}, frame.B = {0, 0.1}, frame.C = {0.2, 0.1}, frame.D = {0.2, 0};
  frame.k_A = frame.k_D = 2;
  const auto m = Share(frame.Definition());
  const auto modes =
      ComputeBucklingModes(*m, VectorX::Zero(3), {{m->FindBody("coupler"), Vector3(0, -1, 0)}}, {});
  ASSERT_TRUE(modes) << modes.error().Text();
  ASSERT_EQ(modes->size(), 1u);
  EXPECT_NEAR(modes->front().factor, 2 * 2 / 0.1, 1e-5);
}

TEST(Buckling, RefusesWhatNothingHoldsBefore) {
  const auto m = Share(testing::Chain(2, 0.1, 0.1, 0));
  const auto modes =
      ComputeBucklingModes(*m, VectorX::Zero(2), {{m->FindBody("tip"), Vector3(-1, 0, 0)}}, {});
  ASSERT_FALSE(modes);
  EXPECT_EQ(modes.error().code, ErrorCode::kUnderdetermined);
}

}  // namespace
}  // namespace fork1s
