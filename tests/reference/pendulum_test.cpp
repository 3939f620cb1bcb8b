// Motion against differential equations: implicit Euler has an error of first order, so it halves with the
// step.
#include <cmath>

#include "support.hpp"

namespace fork1s::reference_test {
namespace {

// An error e(h) = a h + b h² with b h much below a gives a slope of 1 within these; 1000 steps in 1 s do.
constexpr double kSlopeError = 0.1;

Scene Falling(int links) { return Of(testing::Chain(links, 1, 1, 0), Vector3(0, -kGravity, 0)); }

double FinalError(const Scene& scene, const VectorX& expected, double h) {
  FullSimulation s = Start(scene, h);
  Advance(s, 1);
  return (s.Displacements(0) - expected).norm();
}

void ExpectFirstOrder(const Scene& scene, const VectorX& expected) {
  const double coarse = FinalError(scene, expected, 1e-3), fine = FinalError(scene, expected, 5e-4);
  EXPECT_NEAR(std::log2(coarse / fine), 1, kSlopeError) << coarse << " " << fine;
  // Of a swing of some radians.
  EXPECT_LT(fine, 0.02);
}

TEST(Pendulum, FallsAsItsEquationSays) {
  // A thin rod from the horizontal: q̈ = -3/2 g cos q.
  const VectorX end =
      Integrate([](const VectorX& x) { return VectorX(Vector2(x(1), -1.5 * kGravity * std::cos(x(0)))); },
                VectorX(Vector2::Zero()), 1, 10000);
  ExpectFirstOrder(Falling(1), end.head(1));
}

TEST(DoublePendulum, FallsAsItsEquationsSay) {
  // Two rods, m = l = 1, absolute angles a and b from the horizontal.
  auto rate = [](const VectorX& x) {
    const double c = 0.5 * std::cos(x(0) - x(1)), s = 0.5 * std::sin(x(0) - x(1));
    Eigen::Matrix2d M;
    M << 4.0 / 3, c, c, 1.0 / 3;
    const Vector2 force(-s * x(3) * x(3) - 1.5 * kGravity * std::cos(x(0)),
                        s * x(2) * x(2) - 0.5 * kGravity * std::cos(x(1)));
    VectorX out(4);
    out << x.tail(2), M.inverse() * force;
    return out;
  };
  const VectorX end = Integrate(rate, VectorX(Vector4::Zero()), 1, 20000);
  ExpectFirstOrder(Falling(2), Vector2(end(0), end(1) - end(0)));
}

TEST(Pendulum, EveryTurnIsCounted) {
  Scene scene = Of(testing::Chain(1, 1, 1, 0));
  StartAt(scene, VectorX::Zero(1), VectorX::Constant(1, 10));
  FullSimulation s = Start(scene, 0.01);
  Advance(s, 2);
  // Nothing acts: 20 rad, three turns and some. Rounding of 200 steps.
  EXPECT_NEAR(s.Displacements(0)(0), 20, 1e-10);
  EXPECT_NEAR(s.Pose(s.FindBody("tip")).translation().x(), std::cos(20), 1e-10);
}

TEST(Spring, DampedOscillatorDecays) {
  // q̈ = -(k q + d q̇) / I with I = 1/3, let go at 0.5 rad.
  Scene scene = Of(testing::Chain(1, 1, 1, 30, 0.4));
  StartAt(scene, VectorX::Constant(1, 0.5), VectorX::Zero(1));
  const VectorX end =
      Integrate([](const VectorX& x) { return VectorX(Vector2(x(1), -3 * (30 * x(0) + 0.4 * x(1)))); },
                VectorX(Vector2(0.5, 0)), 1, 10000);
  ExpectFirstOrder(scene, end.head(1));
}

}  // namespace
}  // namespace fork1s::reference_test
