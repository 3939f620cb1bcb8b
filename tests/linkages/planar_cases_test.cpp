// Planar linkages whose answers are known by hand, turned, scaled and written down in several ways.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <initializer_list>

#include "methods_expected.hpp"
#include "random_linkage.hpp"

namespace fork1s::linkages {
namespace {

SpatialInertia Bar() { return {0.1, Vector3(0.05, 0, 0), Vector3(1e-4, 2e-4, 2e-4).asDiagonal()}; }

// A base and bars with their frames at points of the plane z = 0.
Sketch Plane(std::initializer_list<Vector2> origins) {
  Sketch s;
  s.family = "planar case";
  s.AddBody(RigidTransform(), Bar());
  for (const Vector2& p : origins) s.AddBody(RigidTransform(Vector3(p.x(), p.y(), 0)), Bar());
  return s;
}
Pair& Pin(Sketch& s, int a, int b, const Vector2& at, double stiffness = 0,
          PairKind kind = PairKind::kHinge) {
  Pair& p = s.AddPair(a, b, kind, Vector3(at.x(), at.y(), 0), Matrix3::Identity());
  p.k_turn = stiffness;
  return p;
}
Pair& Slider(Sketch& s, int a, int b, const Vector2& at, const Vector2& along, double stiffness = 0) {
  Pair& p = s.AddPair(a, b, PairKind::kSlide, Vector3(at.x(), at.y(), 0),
                      FrameAlong(Vector3(along.x(), along.y(), 0)));
  p.k_slide = stiffness;
  return p;
}

// Turned about the plane's normal and out of it, near the root and far from it, small and large, and written
// down with other trees.
void ForPlanarVariations(const Sketch& sketch,
                         const std::function<void(const Sketch&, const Writing&)>& check) {
  unsigned seed = 0;
  for (const double angle : {0.0, 0.35, 0.7, 1.3, 2.9})
    for (const double scale : {1e-2, 1.0, 100.0}) {
      SCOPED_TRACE(::testing::Message() << "turned by " << angle << ", scaled by " << scale);
      Sketch s = WithRoot(sketch, RigidTransform(ExpRotation(Vector3(0, 0, angle)), Vector3::Zero()));
      check(Scaled(s, scale), {.keep_order = true});
      s = WithRoot(sketch, RandomPose(seed, sketch.size * (seed % 3 == 0 ? 30 : 1)));
      check(Scaled(Moved(s, RandomPose(seed + 1, 1)), scale), {.seed = seed});
      ++seed;
    }
}

// Ground pins 0.2 m apart, cranks of 0.15 m, distal links that meet.
struct FiveBar {
  Vector2 A{0, 0}, E{0.2, 0};
  double crank = 0.15, distal = 0.2, turn_1 = 2.0, turn_2 = 0.9;
  double k_1 = 2, k_2 = 30;

  struct Pose {
    Vector2 B, D, C;  // ends of the cranks, and where the distal links meet
    double angle_1, angle_2;
  };
  Pose At(double a, double b) const {
    Pose p;
    p.B = A + crank * Vector2(std::cos(a), std::sin(a));
    p.D = E + crank * Vector2(std::cos(b), std::sin(b));
    const Vector2 half = 0.5 * (p.D - p.B);
    const double height = std::sqrt(distal * distal - half.squaredNorm());
    p.C = p.B + half + height * Vector2(-half.y(), half.x()).normalized();
    p.angle_1 = std::atan2((p.C - p.B).y(), (p.C - p.B).x());
    p.angle_2 = std::atan2((p.C - p.D).y(), (p.C - p.D).x());
    return p;
  }

  Sketch Draw(PairKind last = PairKind::kHinge) const {
    const Pose p = At(turn_1, turn_2);
    Sketch s = Plane({A, E, p.B, p.D});
    Pin(s, 0, 1, A, k_1);
    Pin(s, 0, 2, E, k_2);
    Pin(s, 1, 3, p.B);
    Pin(s, 2, 4, p.D);
    Pin(s, 3, 4, p.C, 0, last);
    s.interfaces = {3, 4};
    s.size = 0.2;
    return s;
  }

  // [turn about z; displacement] of both distal links a radian of each crank, closed form and its difference:
  // fourth order at 1e-3 leaves 1e-12.
  MatrixX Columns() const {
    MatrixX J(12, 2);
    J.setZero();
    const double h = 1e-3;
    for (int i = 0; i < 2; ++i) {
      auto at = [&](double d) {
        const Pose p = At(turn_1 + (i == 0 ? d : 0), turn_2 + (i == 1 ? d : 0));
        Vector6 y;
        y << p.angle_1, p.B, p.angle_2, p.D;
        return y;
      };
      const Vector6 d = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
      J.col(i)(2) = d(0);
      J.col(i).segment<2>(3) = d.segment<2>(1);
      J.col(i)(8) = d(3);
      J.col(i).segment<2>(9) = d.segment<2>(4);
    }
    return J;
  }
};

TEST(FiveBar, BothGroundSpringsAreFelt) {
  const FiveBar bar;
  const MatrixX J = bar.Columns();
  const MatrixX C = J * Vector2(1 / bar.k_1, 1 / bar.k_2).asDiagonal() * J.transpose();
  const Methods r(bar.Draw(), {.keep_order = true});
  EXPECT_LT(RelativeDifference(r.plain.C, C, bar.E.x(), 0), 1e-10);
  EXPECT_LT(RelativeDifference(r.walk.C, C, bar.E.x(), 0), 1e-10);
  EXPECT_LT(RelativeDifference(r.dense.C, C, bar.E.x(), 0), 1e-10);
}

TEST(FiveBar, HasTwoElasticMotionsHoweverItIsWritten) {
  for (const PairKind last : {PairKind::kHinge, PairKind::kBall})
    ForPlanarVariations(FiveBar().Draw(last), [](const Sketch& s, const Writing& w) {
      ExpectMethods(Methods(s, w), {.mobility = 2, .interface_rank = 2});
    });
}

TEST(FiveBar, OfAnyShapeHasTwoElasticMotions) {
  for (unsigned seed = 0; seed < 100; ++seed) {
    SCOPED_TRACE(seed);
    const std::vector<double> x = RandomNumbers(seed, 6);
    FiveBar bar;
    bar.turn_1 = 1.6 + x[0];
    bar.turn_2 = 0.4 + x[1];
    bar.crank = 0.08 + 0.1 * x[2];
    bar.distal = 0.25 + 0.1 * x[3];
    bar.k_1 = std::pow(10, 6 * x[4] - 3);
    bar.k_2 = std::pow(10, 6 * x[5] - 3);
    const Sketch s = bar.Draw(seed % 2 ? PairKind::kHinge : PairKind::kBall);
    for (const double angle : {0.0, 0.7}) {
      const Sketch turned =
          WithRoot(s, RigidTransform(ExpRotation(Vector3(0.5 * angle, 0, angle)), Vector3::Zero()));
      ExpectMethods(Methods(turned, {.keep_order = true}), {.mobility = 2, .interface_rank = 2});
      ExpectMethods(Methods(turned, {.seed = seed}), {.mobility = 2, .interface_rank = 2});
    }
  }
}

// Crank, coupler and rocker on body `ground`, from its pin A to its pin D; returns the coupler.
int AddFourBar(Sketch& s, int ground, const Vector2& A, const Vector2& B, const Vector2& C, const Vector2& D,
               double k_A, double k_D, PairKind last = PairKind::kHinge) {
  const int crank = s.AddBody(RigidTransform(Vector3(A.x(), A.y(), 0)), Bar()),
            coupler = s.AddBody(RigidTransform(Vector3(B.x(), B.y(), 0)), Bar()),
            rocker = s.AddBody(RigidTransform(Vector3(D.x(), D.y(), 0)), Bar());
  Pin(s, ground, crank, A, k_A);
  Pin(s, crank, coupler, B);
  Pin(s, ground, rocker, D, k_D);
  Pin(s, coupler, rocker, C, 0, last);
  return coupler;
}

TEST(FourBar, IsOneMotionHoweverItIsClosed) {
  for (const PairKind last : {PairKind::kHinge, PairKind::kBall}) {
    Sketch s = Plane({});
    const int coupler = AddFourBar(s, 0, {0, 0}, {0, 0.1}, {0.15, 0.15}, {0.2, 0}, 2, 0.5, last);
    s.interfaces = {coupler};
    s.size = 0.15;
    const double first = Methods(s, {.keep_order = true}).frequencies.at(0);
    ForPlanarVariations(s, [&](const Sketch& sketch, const Writing& w) {
      const Methods r(sketch, w);
      ExpectMethods(r, {.mobility = 1, .interface_rank = 1});
      // A turning spring knows no lengths, inertia grows with their square.
      ASSERT_EQ(r.frequencies.size(), 1u);
      EXPECT_NEAR(r.frequencies[0] * sketch.size / s.size, first, 1e-9 * first);
    });
  }
}

TEST(FourBar, TwoInSeriesAddTheirCompliances) {
  for (const double k_2 : {1e-3, 1.0, 1e3}) {
    Sketch s = Plane({});
    const int first = AddFourBar(s, 0, {0, 0}, {0, 0.1}, {0.15, 0.15}, {0.2, 0}, 2, 0);
    const int second = AddFourBar(s, first, {0.03, 0.16}, {0, 0.3}, {0.16, 0.27}, {0.13, 0.18}, k_2, 0);
    s.interfaces = {second, first};
    s.size = 0.15;
    ForPlanarVariations(s, [](const Sketch& sketch, const Writing& w) {
      ExpectMethods(Methods(sketch, w), {.mobility = 2, .interface_rank = 2});
    });
  }
}

// A sprung hinge on an unsprung one, tied to an unsprung slide by a point: one spring, one motion.
TEST(SlideAndTwoHinges, OneSpringDecidesOneMotion) {
  Sketch s = Plane({Vector2(0.10, -0.06), Vector2(0.03, 0.03), Vector2(0.12, -0.19)});
  Pin(s, 0, 1, {0.10, -0.06});
  Slider(s, 0, 2, {0.03, 0.03}, {-0.45, 0.89});
  Pin(s, 1, 3, {0.12, -0.19}, 1.17);
  Pin(s, 2, 3, {0.03, 0.12}, 0, PairKind::kBall);
  s.interfaces = {1, 3};
  s.size = 0.1;
  ForPlanarVariations(s, [](const Sketch& sketch, const Writing& w) {
    ExpectMethods(Methods(sketch, w), {.mobility = 1, .interface_rank = 1});
  });
}

// Three bars pinned to a triangle hold whatever springs they carry.
TEST(LockedSprings, HaveNoFrequency) {
  for (const PairKind last : {PairKind::kHinge, PairKind::kBall})
    for (const int sprung : {1, 3, 7}) {
      Sketch s = Plane({Vector2(0, 0), Vector2(0.2, 0.1)});
      Pin(s, 0, 1, {0, 0}, sprung & 1 ? 5 : 0);
      Pin(s, 1, 2, {0.2, 0.1}, sprung & 2 ? 600 : 0);
      Pin(s, 2, 0, {0.1, -0.05}, sprung & 4 ? 0.01 : 0, last);
      s.interfaces = {2};
      s.size = 0.15;
      ForPlanarVariations(s, [](const Sketch& sketch, const Writing& w) {
        const Methods r(sketch, w);
        EXPECT_EQ(r.frequencies.size(), 0u);
        ExpectMethods(r, {});
      });
    }
}

// Two points of one body on two of another: a slide with a spring between hinges that cannot turn.
TEST(LockedSprings, BehindTwoPointsOnTwoBodies) {
  Sketch s = Plane({Vector2(0.01, -0.02), Vector2(0.07, 0.12), Vector2(0.08, -0.15)});
  Pin(s, 0, 1, {0.01, -0.02});
  Slider(s, 1, 2, {0.07, 0.12}, {0.75, -0.66}, 665);
  Pin(s, 1, 3, {0.08, -0.15});
  Pin(s, 1, 3, {-0.01, -0.06}, 0, PairKind::kBall);
  Pin(s, 2, 3, {0.12, 0.2}, 0, PairKind::kBall);
  s.interfaces = {2};
  s.size = 0.15;
  // The whole turns about the first hinge, and the interface with it; the slide is held.
  ForPlanarVariations(s, [](const Sketch& sketch, const Writing& w) {
    const Methods r(sketch, w);
    EXPECT_EQ(r.frequencies.size(), 0u);
    ExpectMethods(r, {.mobility = 1, .interface_free = 1});
  });
}

// The interface swings free beside a triangle that holds the only spring.
TEST(LockedSprings, BesideAFreeInterface) {
  Sketch s = Plane({Vector2(0, 0), Vector2(0.1, 0.03), Vector2(0, -0.1)});
  Pin(s, 0, 1, {0, 0}, 5);
  Pin(s, 1, 2, {0.1, 0.03});
  Pin(s, 2, 0, {0.2, -0.02}, 0, PairKind::kBall);
  Pin(s, 0, 3, {0, -0.1});
  s.interfaces = {3};
  s.size = 0.1;
  ForPlanarVariations(s, [](const Sketch& sketch, const Writing& w) {
    const Methods r(sketch, w);
    EXPECT_EQ(r.frequencies.size(), 0u);
    ExpectMethods(r, {.mobility = 1, .interface_free = 1});
  });
}

}  // namespace
}  // namespace fork1s::linkages
