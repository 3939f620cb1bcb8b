// Friction with two coefficients, and surfaces that move within themselves.
#include <gtest/gtest.h>

#include <cmath>

#include "random_problems.hpp"

namespace fork1s {
namespace {

using testing::AsGiven;
using testing::kGravity;
using testing::kStep;
using testing::Problem;
using testing::RandomProblem;
using testing::Uniform;

/// Largest violation of elliptic friction, by its definition: relative to the fastest contact velocity.
double EllipseViolation(const Problem& p, const VectorX& start) {
  double worst = 0, speed = 1e-12;
  for (const ContactConstraint& c : p.contacts) {
    const MatrixX J = p.RowsOf(c);
    const double inverse_mass = (J * p.FullW() * J.transpose()).trace() / 3, normal = c.impulse[0],
                 largest = c.friction_scale.maxCoeff();
    const Vector2 a = c.friction_scale / largest, load = c.impulse.tail<2>().cwiseQuotient(a);
    Vector3 w = J * p.velocity + c.bias;
    w[0] += c.compliance_normal * normal;
    w.tail<2>() +=
        c.compliance_tangent * (c.impulse - c.previous_impulse).tail<2>().cwiseQuotient(a.cwiseAbs2());
    const double bound = c.friction * largest * normal, dissipation = a.cwiseProduct(w.tail<2>()).norm();
    speed = std::max({speed, (J * start + c.bias).norm(), inverse_mass * c.impulse.norm()});
    worst = std::max({worst, -inverse_mass * normal, -w[0], std::min(inverse_mass * normal, std::abs(w[0])),
                      inverse_mass * (load.norm() - bound)});
    if (!(dissipation > 0)) continue;
    const Vector2 sliding = -bound / dissipation * a.cwiseAbs2().cwiseProduct(w.tail<2>());
    worst = std::max(worst, std::min(dissipation, inverse_mass * (c.impulse.tail<2>() - sliding).norm()));
  }
  return worst / speed;
}

/// A flat box on an incline whose rise has the angle `azimuth` to tangent 1; after `steps` its velocity along both
/// tangents [m/s] in `sliding`.
struct Incline {
  Vector2 velocity = Vector2::Zero();
  double rotation = 0;
};
Incline SlideDown(double slope, double azimuth, double friction, const Vector2& scale, int steps) {
  Problem p = testing::BoxOnPlane(2, friction, 0.2, 0.01);
  const Matrix3 frame = testing::FrameOf(Vector3::UnitZ());
  const Vector3 down =
      std::sin(slope) * (std::cos(azimuth) * frame.row(1) + std::sin(azimuth) * frame.row(2));
  p.velocity.setZero();
  for (ContactConstraint& c : p.contacts) {
    c.friction_scale = scale;
    c.compliance_normal = c.compliance_tangent = 1e-4;
  }
  ContactSolver solver;
  for (int step = 0; step < steps; ++step) {
    p.velocity.tail<3>() += kStep * kGravity * (down - std::cos(slope) * Vector3::UnitZ());
    EXPECT_TRUE(solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven()).converged);
    for (ContactConstraint& c : p.contacts) {
      c.previous_impulse = c.impulse;
      c.previous_utilization = c.utilization;
    }
  }
  return {frame.bottomRows<2>() * p.velocity.tail<3>(), p.velocity.head<3>().norm()};
}

// µ = 0.6 along tangent 1 and 0.2 along tangent 2, on an incline of 0.4 rad, tan = 0.42.
TEST(EllipticFriction, BlockSlidesAlongTheWeakTangentAndSticksAlongTheOther) {
  const double slope = 0.4, seconds = 0.5;
  const int steps = static_cast<int>(seconds / kStep);
  const Vector2 scale(1, 1.0 / 3);
  EXPECT_LT(SlideDown(slope, 0, 0.6, scale, steps).velocity.norm(), 1e-3);
  const Incline slides = SlideDown(slope, M_PI / 2, 0.6, scale, steps);
  const double expected = kGravity * (std::sin(slope) - 0.2 * std::cos(slope)) * steps * kStep;
  EXPECT_NEAR(slides.velocity[1], expected, 1e-3 * expected);
  EXPECT_NEAR(slides.velocity[0], 0, 1e-6);
}

// Between the two it begins to slide where (sin² φ/µ_2² + cos² φ/µ_1²)^½ tan(slope) is 1.
TEST(EllipticFriction, BlockBeginsToSlideAtTheEllipse) {
  const double azimuth = 0.7, edge = 1 / std::hypot(std::cos(azimuth) / 0.6, std::sin(azimuth) / 0.2);
  const Vector2 scale(1, 1.0 / 3);
  EXPECT_LT(SlideDown(std::atan(0.99 * edge), azimuth, 0.6, scale, 60).velocity.norm(), 1e-3);
  EXPECT_GT(SlideDown(std::atan(1.01 * edge), azimuth, 0.6, scale, 60).velocity.norm(), 0.01);
}

TEST(EllipticFriction, SlipHasTheDirectionOfMaximumDissipation) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 300; ++trial) {
    Problem p = testing::BoxOnPlane(1, Uniform(random, 0.1, 0.5), 0.2, 0.001);
    const Vector2 scale(Uniform(random, 0.1, 1), trial % 5 == 0 ? 0 : Uniform(random, 0.1, 1));
    for (ContactConstraint& c : p.contacts) c.friction_scale = scale;
    p.velocity.segment<2>(3) << Uniform(random, -1, 1), Uniform(random, -1, 1);
    const Vector3 before = p.velocity.tail<3>();
    ContactSolver solver;
    ASSERT_TRUE(solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven()).converged);
    const Matrix3 frame = testing::FrameOf(Vector3::UnitZ());
    const Vector2 change = frame.bottomRows<2>() * (p.velocity.tail<3>() - before),
                  slip = frame.bottomRows<2>() * p.velocity.tail<3>();
    const double bound = p.contacts[0].friction * kGravity * kStep,
                 dissipation = scale.cwiseProduct(slip).norm();
    if (dissipation < 1e-3) continue;  // it sticks, or slides along a tangent without friction
    const Vector2 expected = -bound / dissipation * scale.cwiseAbs2().cwiseProduct(slip);
    EXPECT_LT((change - expected).norm(), 1e-6 * bound) << trial;
  }
}

TEST(EllipticFriction, HoldsInRandomProblems) {
  std::mt19937 random(2);
  ContactSolver solver;
  int failures = 0;
  for (int trial = 0; trial < 400; ++trial) {
    Problem p = RandomProblem(random, trial % 3, 1 + trial % 4, 1 + trial % 12, Uniform(random, 0.1, 0.8));
    for (ContactConstraint& c : p.contacts) {
      c.friction_scale << Uniform(random, 0.1, 1.5), Uniform(random, 0.1, 1.5);
      c.compliance_normal = c.compliance_tangent = 7e-4;
      c.bias.tail<2>() << Uniform(random, -0.3, 0.3), Uniform(random, -0.3, 0.3);
    }
    const VectorX start = p.velocity;
    if (!solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven()).converged) {
      ++failures;
      continue;
    }
    EXPECT_LT(EllipseViolation(p, start), 1e-8) << trial;
  }
  EXPECT_LE(failures, 2);
}

// The same ellipse from tangents that are turned by a right angle.
TEST(EllipticFriction, TurnedTangentsGiveTheSameMotion) {
  std::mt19937 random(3);
  Matrix3 quarter;
  quarter << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  ContactSolver solver;
  for (int trial = 0; trial < 100; ++trial) {
    Problem p = RandomProblem(random, 1, 2, 4, 0.3);
    for (ContactConstraint& c : p.contacts) {
      c.friction_scale << 1, Uniform(random, 0.1, 1);
      c.rolling = c.torsion = 0.01;
      c.compliance_normal = c.compliance_tangent = 1e-2;
    }
    Problem turned = p;
    for (ContactConstraint& c : turned.contacts) {
      c.J_a = quarter * c.J_a;
      c.J_b = quarter * c.J_b;
      std::swap(c.friction_scale[0], c.friction_scale[1]);
    }
    if (!solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven()).converged) continue;
    ASSERT_TRUE(solver.Solve(p.blocks, turned.contacts, p.limits, turned.velocity, AsGiven()).converged);
    EXPECT_LT((p.velocity - turned.velocity).norm(), 1e-8 * (1 + p.velocity.norm())) << trial;
  }
}

TEST(EllipticFriction, LeavesRollingFrictionAsItIs) {
  std::mt19937 random(4);
  ContactSolver solver;
  for (int trial = 0; trial < 100; ++trial) {
    Problem p = RandomProblem(random, 1, 2, 3, 0);
    for (ContactConstraint& c : p.contacts) {
      c.rolling = c.torsion = 0.02;
      c.compliance_normal = c.compliance_tangent = 1e-2;
    }
    Problem elliptic = p;
    for (ContactConstraint& c : elliptic.contacts) c.friction_scale << 1, 0.2;
    if (!solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven()).converged) continue;
    ASSERT_TRUE(solver.Solve(p.blocks, elliptic.contacts, p.limits, elliptic.velocity, AsGiven()).converged);
    EXPECT_LT((p.velocity - elliptic.velocity).norm(), 1e-8 * (1 + p.velocity.norm())) << trial;
  }
}

// A belt of 0.5 m/s takes a box along by µ g until both have one speed.
TEST(MovingSurface, TakesABoxToItsSpeed) {
  const double belt = 0.5, friction = 0.3;
  Problem p = testing::BoxOnPlane(2, friction, 0.2, 0.01);
  p.velocity.setZero();
  const Vector3 along = testing::FrameOf(Vector3::UnitZ()).row(1);
  for (ContactConstraint& c : p.contacts) c.bias[1] = -belt;
  ContactSolver solver;
  for (int step = 1; step <= 30; ++step) {
    p.velocity[5] -= kGravity * kStep;
    ASSERT_TRUE(solver.Solve(p.blocks, p.contacts, p.limits, p.velocity).converged);
    EXPECT_NEAR(along.dot(p.velocity.tail<3>()), std::min(belt, friction * kGravity * kStep * step), 1e-6);
  }
}

TEST(EllipticFriction, CoefficientAlongAnImpulse_IsThatOfTheEllipse) {
  ContactConstraint c;
  c.friction = 0.8;
  c.friction_scale << 1, 0.25;
  EXPECT_EQ(c.FrictionAlong(Vector2::Zero()), 0.8);
  EXPECT_NEAR(c.FrictionAlong(Vector2(-3, 0)), 0.8, 1e-15);
  EXPECT_NEAR(c.FrictionAlong(Vector2(0, 3)), 0.2, 1e-15);
  const Vector2 along = c.FrictionAlong(Vector2(1, 1)) * Vector2(1, 1).normalized();
  EXPECT_NEAR(along.cwiseQuotient(Vector2(0.8, 0.2)).norm(), 1, 1e-14);
  c.friction_scale << 0, 2;
  EXPECT_NEAR(c.FrictionAlong(Vector2(0, 1)), 1.6, 1e-15);
  EXPECT_NEAR(c.FrictionAlong(Vector2(1, 0)), 1.6 * ContactConstraint::kMinFrictionScale, 1e-22);
  c.friction_scale.setZero();
  EXPECT_EQ(c.FrictionAlong(Vector2(1, 0)), 0);
}

}  // namespace
}  // namespace fork1s
