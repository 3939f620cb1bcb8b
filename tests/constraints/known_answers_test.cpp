#include <gtest/gtest.h>

#include "constraints/regularized_contact_problem.hpp"
#include "problems.hpp"

namespace fork1s {
namespace {

using testing::BoxOnPlane;
using testing::kGravity;
using testing::kStep;
using testing::LawViolation;
using testing::Problem;
using testing::RigidBodyW;
using testing::TouchAt;

ContactSolverReport SolveProblem(Problem& p, const ContactSolverOptions& options = {}) {
  ContactSolver solver;
  return solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, options);
}

// A light ball that carries a heavy one: sweeps pass on a thousandth of the load each.
Problem HeavyOnLight(double light, double heavy) {
  Problem p;
  p.W = {RigidBodyW(light, 0.4 * light * 1e-4), RigidBodyW(heavy, 0.4 * heavy * 1e-2)};
  p.Finish();
  p.contacts = {TouchAt(-1, Vector3::Zero(), 0, Vector3(0, 0, -0.01), Vector3::UnitZ(), 0.5),
                TouchAt(0, Vector3(0, 0, 0.01), 6, Vector3(0, 0, -0.1), Vector3::UnitZ(), 0.5)};
  p.velocity[5] = p.velocity[11] = -kGravity * kStep;
  return p;
}

TEST(Contact, HeavyBallOnLightBall) {
  Problem p = HeavyOnLight(0.02, 20);
  const ContactSolverReport report = SolveProblem(p);
  EXPECT_TRUE(report.converged);
  EXPECT_LE(report.newton_iterations, 4);
  EXPECT_NEAR(p.contacts[1].impulse[0], 20 * kGravity * kStep, 1e-6);
  EXPECT_NEAR(p.contacts[0].impulse[0], 20.02 * kGravity * kStep, 1e-6);
  EXPECT_LT(p.velocity.norm(), 1e-6);
}

TEST(Contact, MassRatioOfAMillion) {
  Problem p = HeavyOnLight(1e-3, 1e3);
  const ContactSolverReport report = SolveProblem(p);
  EXPECT_TRUE(report.converged);
  // Hard contact gives 1e-11 of the inverse mass of the light one: 1e-5 of that of the heavy one, and so much
  // less.
  EXPECT_NEAR(p.contacts[0].impulse[0], (1e3 + 1e-3) * kGravity * kStep, 1e-4 * 163);
}

// Overlaps all around press with a thousand times what is left of them: rounding of what cancels is in every row.
TEST(Contact, OverlapsAllAround_SolvedToRounding) {
  constexpr int kPorts = 3, kFreedoms = 4;
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  const auto draw = [&] { return normal(random); };
  for (int trial = 0; trial < 100; ++trial) {
    Problem p;
    const MatrixX b = MatrixX::NullaryExpr(6 * kPorts, kFreedoms, draw);
    p.W = {b * b.transpose()};
    p.Finish();
    for (int i = 0; i < 120; ++i) {
      const int one = 6 * (i % kPorts), other = 6 * ((i + 1 + i / kPorts % 2) % kPorts);
      ContactConstraint c = TouchAt(one, 0.3 * testing::RandomUnit(random), other,
                                    0.3 * testing::RandomUnit(random), testing::RandomUnit(random), 1);
      c.compliance_normal = 1e-4;
      c.compliance_tangent = 5e-4;
      c.bias[0] = -0.1;
      p.contacts.push_back(c);
    }
    p.velocity = 1e-3 * (b * VectorX::NullaryExpr(kFreedoms, draw));
    const ContactSolverReport report = SolveProblem(p);
    EXPECT_TRUE(report.converged) << trial << ": " << report.residual;
    // Where rounding passes for an error all fallbacks are tried.
    EXPECT_LT(report.fallback, 3) << trial;
  }
}

// Two springs of the material, since nothing moves the plate, whatever the ball bore before.
TEST(Contact, DrivenPlatePressesOnBall_ImpulseOfTheMaterial) {
  constexpr double kMass = 0.03, kSpeed = 0.15, kDepth = 1e-3, kCompliance = 0.01;  // kg, m/s, m/s, 1/kg
  for (const double previous : {0.0, 1.0, 1e4}) {
    Problem p;
    p.W = {RigidBodyW(kMass, 0.4 * kMass * 1e-4), MatrixX::Zero(6, 6)};
    p.Finish();
    p.contacts = {TouchAt(-1, Vector3::Zero(), 0, Vector3(0, 0, -0.01), Vector3::UnitZ(), 0.5),
                  TouchAt(0, Vector3(0, 0, 0.01), 6, Vector3(0, 0, -0.1), Vector3::UnitZ(), 0.5)};
    for (ContactConstraint& c : p.contacts) {
      c.compliance_normal = c.compliance_tangent = kCompliance;
      c.hardening_speed = kDepth;
      c.previous_impulse[0] = c.impulse[0] = previous;
    }
    p.velocity[11] = -kSpeed;
    const ContactSolverReport report = SolveProblem(p);
    EXPECT_TRUE(report.converged);
    EXPECT_EQ(report.fallback, 0);
    EXPECT_TRUE(p.contacts[0].gives_way && p.contacts[1].gives_way);
    const double ball = kSpeed / (2 + kMass * kCompliance);
    EXPECT_NEAR(p.contacts[0].impulse[0], ball / kCompliance, 1e-9 * kSpeed / kCompliance) << previous;
    EXPECT_NEAR(p.contacts[1].impulse[0], (kSpeed - ball) / kCompliance, 1e-9 * kSpeed / kCompliance)
        << previous;
  }
}

// The plate moves as freely as hard contact gives, and a little more or less.
TEST(Contact, PlateIsDriven_WhereItMovesLessThanHardContactGives) {
  constexpr double kMass = 0.03, kDepth = 1e-3;
  const auto pressed = [&](double inverse_mass_of_plate) {
    Problem p;
    p.W = {RigidBodyW(kMass, 0.4 * kMass * 1e-4), MatrixX::Zero(6, 6)};
    p.W[1](5, 5) = inverse_mass_of_plate;
    p.Finish();
    p.contacts = {TouchAt(-1, Vector3::Zero(), 0, Vector3(0, 0, -0.01), Vector3::UnitZ(), 0.5),
                  TouchAt(0, Vector3(0, 0, 0.01), 6, Vector3(0, 0, -0.1), Vector3::UnitZ(), 0.5)};
    for (ContactConstraint& c : p.contacts) {
      c.compliance_normal = c.compliance_tangent = 0.01;
      c.hardening_speed = kDepth;
    }
    p.velocity[11] = -0.15;
    return p;
  };
  const Problem driven = pressed(0);
  internal::RegularizedContactProblem rows;
  ASSERT_TRUE(rows.Prepare(driven.blocks, driven.contacts, {0, 1}, {}, driven.velocity, 1e-3));
  double hard = 0;
  for (const internal::PairRows& pair : rows.pairs) hard += pair.least_R;
  for (const double share : {0.8, 1.25}) {
    Problem p = pressed(share * hard);
    EXPECT_TRUE(SolveProblem(p).converged);
    for (const ContactConstraint& c : p.contacts) EXPECT_EQ(c.gives_way, share < 1) << share;
  }
}

// m/s: what the material of all contacts gives under their impulses, the eighth root of the load beyond its depth.
double GivenByMaterial(const Problem& p) {
  double sum = 0;
  for (const ContactConstraint& c : p.contacts)
    sum += c.hardening_speed * std::pow(std::max(1.0, c.impulse[0] * c.compliance_normal / c.hardening_speed),
                                        1.0 / ContactConstraint::kHardeningExponent);
  return sum;
}

// The load of the last step decides how stiff it is: from step to step a penetration that stays has the load of
// k d (δ/d)⁸, and a load that stays the depth of d (F/(k d))^(1/8).
TEST(Contact, HardensWithTheEighthPowerOfThePenetration) {
  constexpr double kDepth = 1e-3, kCompliance = 0.01, kHeavy = 1e12;  // kg: no load slows it
  for (const double penetration : {0.5, 1.0, 1.2, 2.0}) {
    double impulse = 0;
    for (int step = 0; step < 200; ++step) {
      Problem p;
      p.W = {RigidBodyW(kHeavy, 0.4 * kHeavy * 1e-4)};
      p.Finish();
      p.contacts = {TouchAt(-1, Vector3::Zero(), 0, Vector3(0, 0, -0.01), Vector3::UnitZ(), 0.5)};
      ContactConstraint& c = p.contacts[0];
      c.compliance_normal = c.compliance_tangent = kCompliance;
      c.hardening_speed = kDepth;
      c.previous_impulse[0] = c.impulse[0] = impulse;
      p.velocity[5] = -penetration * kDepth;
      ContactSolverOptions options;
      options.max_relative_regularization = 1e15;
      EXPECT_TRUE(SolveProblem(p, options).converged);
      impulse = p.contacts[0].impulse[0];
    }
    const double linear = kDepth / kCompliance;
    EXPECT_NEAR(impulse / (linear * std::max(penetration, std::pow(penetration, 8))), 1, 1e-6) << penetration;
  }
}

// What is heavy and not driven is held at twice that or less.
TEST(Contact, HeavyPressesOnLight_NoDeeperThanTwiceItsMaterialGives) {
  constexpr double kDepth = 1e-3;
  for (const double ratio : {1e2, 1e4, 1e5})
    for (const double speed : {0.005, 0.15, 3.0}) {
      Problem p = HeavyOnLight(0.01, 0.01 * ratio);
      for (ContactConstraint& c : p.contacts) {
        c.compliance_normal = c.compliance_tangent = 0.01;
        c.hardening_speed = kDepth;
      }
      p.velocity[5] = 0;
      p.velocity[11] = -speed;
      EXPECT_TRUE(SolveProblem(p).converged);
      EXPECT_GT(p.velocity[11], -2.001 * GivenByMaterial(p)) << ratio << ", " << speed;
    }
}

// Of a stack each contact bears the same load and gives a part of the way: none of them alone tells that it is held.
TEST(Contact, HeavyPressesOnStack_NoDeeperThanTwiceItsMaterialGives) {
  constexpr double kDepth = 1e-3;
  for (const int count : {2, 5, 20})
    for (const double ratio : {1e3, 1e5, 1e6})
      for (const double speed : {2.1 * kDepth * (count + 1), 0.15, 3.0}) {
        Problem p;
        for (int i = 0; i < count; ++i) p.W.push_back(RigidBodyW(1e-3, 0.4e-7));
        p.W.push_back(RigidBodyW(1e-3 * ratio, 0.4e-5 * ratio));
        p.Finish();
        for (int i = 0; i <= count; ++i) {
          p.contacts.push_back(
              TouchAt(6 * (i - 1), Vector3(0, 0, 0.01), 6 * i, Vector3(0, 0, -0.01), Vector3::UnitZ(), 0.5));
          if (i == 0) p.contacts.back().port_a = -1;
          p.contacts.back().compliance_normal = p.contacts.back().compliance_tangent = 0.01 * (1 + i % 3);
          p.contacts.back().hardening_speed = kDepth;
        }
        p.velocity[6 * count + 5] = -speed;
        EXPECT_TRUE(SolveProblem(p).converged);
        for (const ContactConstraint& c : p.contacts) EXPECT_FALSE(c.gives_way);
        EXPECT_GT(p.velocity[6 * count + 5], -2.1 * GivenByMaterial(p))
            << count << ", " << ratio << ", " << speed;
      }
}

TEST(Contact, BoxSticksBelowTheCone) {
  const double mass = 2, mu = 0.5;
  Problem p = BoxOnPlane(mass, mu);
  p.velocity[3] = 0.9 * mu * kGravity * kStep;
  EXPECT_TRUE(SolveProblem(p).converged);
  EXPECT_LT(p.velocity.norm(), 1e-7 * kGravity * kStep);
}

TEST(Contact, BoxSlidesAboveTheCone) {
  const double mass = 2, mu = 0.3;
  // Low, so that it slides rather than tips.
  Problem p = BoxOnPlane(mass, mu, 0.2, 0.02);
  const Vector3 push(0.5, 0.2, 0);
  p.velocity.tail<3>() += push;
  EXPECT_TRUE(SolveProblem(p).converged);
  const double normal = mass * kGravity * kStep;
  double sum = 0;
  Vector3 friction = Vector3::Zero();
  for (const ContactConstraint& c : p.contacts) {
    sum += c.impulse[0];
    Vector3 lambda = c.impulse;
    lambda[0] = 0;
    friction += c.J_b.rightCols<3>().transpose() * lambda;
  }
  EXPECT_NEAR(sum, normal, 1e-8);
  EXPECT_LT((friction + mu * normal * push.normalized()).norm(), 1e-8);
  EXPECT_LT((p.velocity.tail<3>() - (push - mu * kGravity * kStep * push.normalized())).norm(), 1e-8);
}

TEST(Contact, TheLawAtTheConeItself) {
  for (double side : {1 - 1e-6, 1.0, 1 + 1e-6}) {
    Problem p;
    p.W = {RigidBodyW(1, 1)};
    p.Finish();
    p.contacts = {TouchAt(-1, Vector3::Zero(), 0, Vector3::Zero(), Vector3::UnitZ(), 0.5)};
    p.velocity << 0, 0, 0, side * 0.5, 0, -1;
    EXPECT_TRUE(SolveProblem(p).converged);
    EXPECT_NEAR(p.velocity[3], std::max(0.0, side * 0.5 - 0.5), 1e-8);
    EXPECT_NEAR(p.contacts[0].impulse[0], 1, 1e-8);
  }
}

TEST(Contact, ZeroFriction) {
  Problem p = BoxOnPlane(1, 0);
  p.velocity[3] = 1;
  EXPECT_TRUE(SolveProblem(p).converged);
  EXPECT_DOUBLE_EQ(p.velocity[3], 1);
  EXPECT_NEAR(p.velocity[5], 0, 1e-5);
}

TEST(Contact, BoxBetweenTwoFingers) {
  // Two fingers on springs, four points each: seven of the eight normals are redundant.
  Problem p;
  const double mass = 0.2, grip = 0.05;
  p.W = {RigidBodyW(mass, 1e-3), RigidBodyW(0.05, 1e-4), RigidBodyW(0.05, 1e-4)};
  p.Finish();
  for (int side : {-1, 1}) {
    for (double y : {-0.01, 0.01}) {
      for (double z : {-0.01, 0.01}) {
        p.contacts.push_back(TouchAt(side < 0 ? 6 : 12, Vector3(-0.02 * side, y, z), 0,
                                     Vector3(0.03 * side, y, z), Vector3(-side, 0, 0), 0.8));
      }
    }
  }
  p.velocity[5] = -kGravity * kStep;
  p.velocity[9] = grip / 0.05;
  p.velocity[15] = -grip / 0.05;
  const VectorX start = p.velocity;
  const ContactSolverReport report = SolveProblem(p);
  EXPECT_TRUE(report.converged);
  EXPECT_LT(LawViolation(p, start, p.velocity), 1e-3);
  EXPECT_NEAR(p.velocity[3], 0, 1e-4);
  // It sticks: all three fall together with the momentum they had.
  EXPECT_NEAR(p.velocity[5], -kGravity * kStep * mass / (mass + 0.1), 1e-4);
}

TEST(Contact, LimitsStopWhatPassesThem) {
  Problem p;
  p.W = {(MatrixX(2, 2) << 2, 1, 1, 3).finished()};
  p.Finish();
  p.velocity << -1, 0.5;
  p.limits.push_back({0, 1, 0, 0});     // v0 ≥ 0
  p.limits.push_back({1, -1, 0.2, 0});  // v1 ≤ 0.2
  const VectorX start = p.velocity;
  EXPECT_TRUE(SolveProblem(p).converged);
  EXPECT_LT(LawViolation(p, start, p.velocity), 1e-4);
  EXPECT_NEAR(p.velocity[0], 0, 1e-4);
  EXPECT_NEAR(p.velocity[1], 0.2, 1e-4);
}

TEST(Contact, NothingToDo) {
  Problem p;
  p.W = {RigidBodyW(1, 1)};
  p.Finish();
  p.velocity[0] = 3;
  const ContactSolverReport report = SolveProblem(p);
  EXPECT_TRUE(report.converged);
  EXPECT_EQ(report.newton_iterations, 0);
  EXPECT_EQ(p.velocity[0], 3);
}

TEST(Contact, SeparatingContactsStayFree) {
  Problem p = BoxOnPlane(1, 0.5);
  p.velocity[5] = 0.1;
  EXPECT_TRUE(SolveProblem(p).converged);
  for (const ContactConstraint& c : p.contacts) EXPECT_EQ(c.impulse, Vector3::Zero());
}

TEST(Contact, ImmovableBodyGetsNoImpulse) {
  // A rigid driven body against the world: no impulse can help, and none appears.
  Problem p;
  p.W = {MatrixX::Zero(6, 6), RigidBodyW(1, 1)};
  p.Finish();
  p.contacts = {TouchAt(-1, Vector3::Zero(), 0, Vector3::Zero(), Vector3::UnitZ(), 0.5),
                TouchAt(0, Vector3::Zero(), 6, Vector3::Zero(), Vector3::UnitZ(), 0.5)};
  p.velocity[5] = -1;
  p.velocity[11] = -3;
  EXPECT_TRUE(SolveProblem(p).converged);
  EXPECT_EQ(p.contacts[0].impulse, Vector3::Zero());
  EXPECT_NEAR(p.contacts[1].impulse[0], 2, 1e-4);
  EXPECT_EQ(p.velocity[5], -1);
}

TEST(Contact, OneFreedomOnly) {
  // A slider that can only move along z, so both tangents are in the null space of W.
  Problem p;
  MatrixX w = MatrixX::Zero(6, 6);
  w(5, 5) = 1;
  p.W = {w};
  p.Finish();
  p.contacts = {TouchAt(-1, Vector3::Zero(), 0, Vector3::Zero(), Vector3::UnitZ(), 0.5)};
  p.velocity << 0, 0, 0, 0.3, 0, -1;
  EXPECT_TRUE(SolveProblem(p).converged);
  EXPECT_NEAR(p.contacts[0].impulse[0], 1, 1e-6);
  EXPECT_NEAR(p.contacts[0].impulse.tail<2>().norm(), 0.5, 1e-6);
}

// Three fingers of two links each on one ball: parts of up to eight freedoms are eliminated first, larger
// ones are factored with the rest. The law holds either way.
TEST(Contact, FingersOfAnyNumberOfFreedoms) {
  std::mt19937 random(5);
  for (const int freedoms : {2, 7, 8, 9, 12})
    for (int draw = 0; draw < 20; ++draw) {
      SCOPED_TRACE(freedoms);
      Problem p;
      for (int finger = 0; finger < 3; ++finger)
        p.Y.push_back(MatrixX::NullaryExpr(freedoms, 12, [&] { return testing::Uniform(random, -1, 1); }));
      p.Y.push_back(MatrixX::Identity(6, 6));
      int offset = 0;
      for (const MatrixX& y : p.Y) {
        const int size = static_cast<int>(y.cols()), rows = static_cast<int>(y.rows());
        p.W.push_back(y.transpose() * y);
        p.blocks.push_back({offset, size, y.data(), rows, rows});
        offset += size;
      }
      p.velocity = VectorX::NullaryExpr(offset, [&] { return testing::Uniform(random, -1, 1); });
      for (int link = 0; link < 6; ++link) {
        const Vector3 n = testing::RandomUnit(random);
        p.contacts.push_back(TouchAt(6 * link, 0.05 * testing::RandomUnit(random), 36, 0.1 * n, -n, 0.4));
        p.contacts.back().compliance_normal = p.contacts.back().compliance_tangent = 1e-3;
      }
      const VectorX start = p.velocity;
      ContactSolverOptions as_given;
      as_given.max_relative_regularization = 1;
      ContactSolver solver;
      ASSERT_TRUE(solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, as_given).converged);
      // The solver ends at 1e-10 of what contact changes, weighed by inertia.
      EXPECT_LT(testing::LawViolation(p, start, p.velocity), 1e-8);
    }
}

// A flap on a hinge, turned anyhow: a point on the axis is moved by the rounding of what cancels there. It
// bears nothing, and what the other point beside it gives is its material's.
TEST(Contact, APointOnAHingesAxisBearsNothing) {
  std::mt19937 random(3);
  int on_axis_below_zero = 0;
  for (int draw = 0; draw < 50; ++draw) {
    SCOPED_TRACE(draw);
    const Vector3 axis = testing::RandomUnit(random), anchor = 0.3 * testing::RandomUnit(random);
    Vector3 arm = testing::RandomUnit(random);
    arm = 0.2 * (arm - axis * axis.dot(arm)).normalized();
    const Vector3 away = axis.cross(arm).normalized();
    Problem p;
    Vector6 freedom;
    freedom << axis, anchor.cross(axis);
    p.W = {MatrixX(4 * freedom * freedom.transpose())};  // per kg·m²
    p.Finish();
    p.contacts = {TouchAt(-1, Vector3::Zero(), 0, anchor + 0.1 * axis, away, 0.5),
                  TouchAt(-1, Vector3::Zero(), 0, anchor + arm, away, 0.5)};
    for (ContactConstraint& c : p.contacts) c.compliance_normal = c.compliance_tangent = 1e-4;
    p.velocity = 2 * freedom;
    const MatrixX J = p.RowsOf(p.contacts[0]);
    on_axis_below_zero += (J * p.FullW() * J.transpose()).trace() < 0 ? 1 : 0;

    Problem apart = p;  // with room: nothing is solved
    for (ContactConstraint& c : apart.contacts) c.bias[0] = 10;
    const ContactSolverReport open = SolveProblem(apart);
    EXPECT_TRUE(open.converged);
    EXPECT_LE(open.newton_iterations, 1);

    // Against the flap's swing: 0.2 m from the axis, 1/0.2² kg m²/4 there.
    for (ContactConstraint& c : p.contacts) c.bias[0] = -1;
    p.velocity = -1e-3 * freedom;
    const ContactSolverReport pressed = SolveProblem(p);
    EXPECT_TRUE(pressed.converged);
    EXPECT_EQ(p.contacts[0].impulse, Vector3::Zero());
    const double speed = p.contacts[1].J_b.row(0).dot(-1e-3 * freedom) - 1, inverse_mass = 4 * 0.2 * 0.2;
    // The material gives no more than its R, 1e-4 of these 0.16.
    EXPECT_NEAR(p.contacts[1].impulse[0], -speed / inverse_mass, -speed / inverse_mass * 1e-4 / inverse_mass);
  }
  EXPECT_GT(on_axis_below_zero, 3) << "the case that went through all stages";
}

TEST(Contact, JawsThatCannotYieldPressTheMaterialIn) {
  // A free box between two driven jaws that close at 1 m/s each: the material gives, R λ = 1 m/s on either
  // side.
  Problem p;
  p.W = {RigidBodyW(1, 0.01), MatrixX::Zero(6, 6), MatrixX::Zero(6, 6)};
  p.Finish();
  p.contacts = {TouchAt(6, Vector3::Zero(), 0, Vector3(-0.1, 0, 0), Vector3::UnitX(), 0.5),
                TouchAt(12, Vector3::Zero(), 0, Vector3(0.1, 0, 0), -Vector3::UnitX(), 0.5)};
  for (ContactConstraint& c : p.contacts) c.compliance_normal = c.compliance_tangent = 1e-4;
  p.velocity[9] = 1;
  p.velocity[15] = -1;
  const ContactSolverReport report = SolveProblem(p);
  EXPECT_TRUE(report.converged);
  for (const ContactConstraint& c : p.contacts) EXPECT_NEAR(c.impulse[0], 1e4, 1e-6);
  EXPECT_NEAR(p.velocity[3], 0, 1e-9);
}

TEST(Contact, NonFiniteInputGivesNoImpulses) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (int what = 0; what < 6; ++what) {
    Problem p = BoxOnPlane(1, 0.5);
    p.contacts[0].impulse = Vector3(1, 0, 0);
    if (what == 0) p.velocity[2] = nan;
    if (what == 1) p.Y[0](3, 3) = inf;
    if (what == 2) p.contacts[1].J_b(0, 0) = nan;
    if (what == 3) p.contacts[1].bias[0] = inf;
    if (what == 4) p.contacts[1].friction = nan;
    if (what == 5) p.contacts[1].impulse[1] = nan;
    EXPECT_FALSE(SolveProblem(p).converged) << what;
    for (const ContactConstraint& c : p.contacts) EXPECT_EQ(c.impulse, Vector3::Zero()) << what;
  }
}

}  // namespace
}  // namespace fork1s
