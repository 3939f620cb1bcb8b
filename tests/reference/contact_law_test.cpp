// The contact laws of the full-coordinate simulator, one by one: derivatives by finite differences, values
// against the implementation of the reduced simulator.
#include <gtest/gtest.h>

#include <cmath>
#include <fork1s/constraints/material.hpp>
#include <random>

#include "constraints/laws/friction_cone.hpp"
#include "reference/bound_laws.hpp"
#include "reference/contact_compliance.hpp"
#include "reference/contact_problem.hpp"
#include "reference/friction_law.hpp"
#include "reference/restitution.hpp"

namespace fork1s::reference {
namespace {

double Draw(std::mt19937& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

Vector3 DrawVector(std::mt19937& random) {
  return Vector3(Draw(random, -1, 1), Draw(random, -1, 1), Draw(random, -1, 1));
}

TEST(FrictionLaw, DerivativeMatchesFiniteDifferences) {
  std::mt19937 random(1);
  int counts[3] = {0, 0, 0};
  for (int draw = 0; draw < 1000; ++draw) {
    const Vector3 w = DrawVector(random), R(Draw(random, 0.1, 1), Draw(random, 0.1, 1), 0);
    const Vector3 compliance(R[0], R[1], R[1]);
    const Vector2 previous = DrawVector(random).tail<2>();
    const double friction = Draw(random, 0, 2), eps = 1e-6;
    const FrictionProjection at = EvaluateFrictionLaw(w, compliance, previous, friction);
    Matrix3 differences;
    bool same_mode = true;
    for (int k = 0; k < 3; ++k) {
      const FrictionProjection ahead =
          EvaluateFrictionLaw(w + eps * Vector3::Unit(k), compliance, previous, friction);
      const FrictionProjection behind =
          EvaluateFrictionLaw(w - eps * Vector3::Unit(k), compliance, previous, friction);
      same_mode = same_mode && ahead.mode == at.mode && behind.mode == at.mode;
      differences.col(k) = (ahead.impulse - behind.impulse) / (2 * eps);
    }
    if (!same_mode) continue;
    ++counts[static_cast<int>(at.mode)];
    EXPECT_LT((differences - at.derivative).norm(), 1e-6 * (1 + at.derivative.norm())) << draw;
  }
  for (const int count : counts) EXPECT_GT(count, 100);
}

TEST(FrictionLaw, DerivativeOfAnEllipseMatchesFiniteDifferences) {
  std::mt19937 random(8);
  constexpr double eps = 1e-6;
  for (int draw = 0; draw < 500; ++draw) {
    const Vector3 y = DrawVector(random);
    const Vector2 shares(Draw(random, 0.2, 1), Draw(random, 0.2, 1));
    const double friction = Draw(random, 0, 2);
    const auto project = [&](const Vector3& at) { return ProjectOntoFrictionCone(at, friction, shares); };
    const double excess = y.tail<2>().cwiseQuotient(shares).norm() - friction * y[0];
    if (std::abs(y[0]) < 1e-4 || std::abs(excess) < 1e-4 || y.tail<2>().norm() < 0.05) continue;
    for (int k = 0; k < 3; ++k) {
      const Vector3 step = eps * Vector3::Unit(k);
      const Vector3 difference = (project(y + step).impulse - project(y - step).impulse) / (2 * eps);
      EXPECT_LT((difference - project(y).derivative.col(k)).norm(), 1e-6) << draw;
    }
  }
}

TEST(FrictionLaw, AgreesWithReducedSimulator) {
  std::mt19937 random(2);
  for (int draw = 0; draw < 1000; ++draw) {
    const Vector3 w = DrawVector(random);
    const Vector2 previous = DrawVector(random).tail<2>();
    internal::FrictionCone law;
    law.R_n = Draw(random, 0.1, 1);
    law.R_t = Draw(random, 0.1, 1);
    law.coefficient = Draw(random, 0, 2);
    Vector3 shifted = w;
    shifted.tail<2>() -= law.R_t * previous;
    const internal::FrictionCone::Trial y = law.AtVelocity(shifted);
    const Vector3 impulse = law.Project(y);
    Matrix3 D;
    law.Derivative(y, D);
    const FrictionProjection mine =
        EvaluateFrictionLaw(w, Vector3(law.R_n, law.R_t, law.R_t), previous, law.coefficient);
    EXPECT_LT((mine.impulse - impulse).norm(), 1e-13 * (1 + impulse.norm())) << draw;
    EXPECT_LT((mine.derivative + D).norm(), 1e-13 * (1 + D.norm())) << draw;
  }
}

TEST(MomentLaw, DerivativeMatchesFiniteDifferences) {
  std::mt19937 random(3);
  constexpr double eps = 1e-6;
  int saturated = 0;
  for (int draw = 0; draw < 500; ++draw) {
    const double y = Draw(random, -1, 1), normal = Draw(random, -0.2, 1), radius = Draw(random, 0, 2);
    const auto value = [&](double dy, double dn) {
      return ProjectMoment(y + dy, radius, normal + dn).moment;
    };
    if (std::abs(normal) < 1e-4 || std::abs(std::abs(y) - radius * std::max(0.0, normal)) < 1e-4) continue;
    const MomentProjection at = ProjectMoment(y, radius, normal);
    EXPECT_NEAR(at.by_y, (value(eps, 0) - value(-eps, 0)) / (2 * eps), 1e-8) << draw;
    EXPECT_NEAR(at.by_normal, (value(0, eps) - value(0, -eps)) / (2 * eps), 1e-8) << draw;
    EXPECT_LE(std::abs(at.moment), radius * std::max(0.0, normal) + 1e-15);
    saturated += at.by_normal != 0;
  }
  EXPECT_GT(saturated, 50);
}

TEST(BoundLaw, DerivativeMatchesFiniteDifferences) {
  std::mt19937 random(4);
  constexpr double eps = 1e-6;
  const double infinity = std::numeric_limits<double>::infinity();
  int saturated = 0;
  for (int draw = 0; draw < 500; ++draw) {
    const bool is_stop = draw % 2 == 0;
    const double upper = is_stop ? infinity : Draw(random, 0, 1), lower = is_stop ? 0 : -upper;
    const double w = Draw(random, -1, 1), R = Draw(random, 0.1, 1),
                 previous = is_stop ? 0 : Draw(random, -upper, upper);
    const auto value = [&](double dw) { return EvaluateBoundLaw(w + dw, R, previous, lower, upper).impulse; };
    const double y = previous - w / R;
    if (std::abs(y - lower) < 1e-4 || std::abs(y - upper) < 1e-4) continue;
    const BoundProjection at = EvaluateBoundLaw(w, R, previous, lower, upper);
    EXPECT_NEAR(at.derivative, (value(eps) - value(-eps)) / (2 * eps), 1e-7) << draw;
    EXPECT_TRUE(at.impulse >= lower && at.impulse <= upper);
    saturated += at.derivative == 0;
  }
  EXPECT_GT(saturated, 50);
}

TEST(Restitution, SatisfiesEnergyBalanceAndAgreesWithReducedSimulator) {
  std::mt19937 random(5);
  int rebounds = 0;
  for (int draw = 0; draw < 5000; ++draw) {
    const double e = Draw(random, 0, 1), v = Draw(random, -0.2, 3), gain = Draw(random, -0.3, 0.5),
                 h = Draw(random, 1e-3, 0.02), gap = Draw(random, -0.001, 0.03);
    const double u = ComputeReboundSpeed(e, v, -v - gain, gap, h), a = gain / h;
    EXPECT_NEAR(u, ReboundSpeed(e, v, -v - gain, gap, h), 1e-12) << draw;
    if (u == 0) continue;
    ++rebounds;
    const double touch = std::max(0.0, v * v + 2 * a * gap);
    EXPECT_NEAR(u * u / 2 + a * (gap + h * u), e * e * touch / 2, 1e-12) << draw;
  }
  EXPECT_GT(rebounds, 1000);
}

TEST(ContactCompliance, AgreesWithReducedSimulator) {
  std::mt19937 random(6);
  for (int draw = 0; draw < 100; ++draw) {
    FullContactMaterial mine;
    ContactMaterial other;
    mine.stiffness = other.stiffness = std::pow(10, Draw(random, 3, 8));
    mine.depth = other.depth = std::pow(10, Draw(random, -6, -3));
    mine.relaxation_steps = other.relaxation_steps = Draw(random, 1, 8);
    mine.max_push_speed = other.max_push_speed = Draw(random, 0.01, 1);
    const double h = std::pow(10, Draw(random, -4, -1)), gap = Draw(random, -0.01, 0.01);
    ContactConstraint c;
    SetMaterial(other, gap, h, c);
    const ContactCompliance compliance = ComputeContactCompliance(mine, h);
    EXPECT_NEAR(compliance.normal / c.compliance_normal, 1, 1e-14);
    EXPECT_NEAR(compliance.tangent / c.compliance_tangent, 1, 1e-14);
    EXPECT_NEAR(compliance.hardening_speed / c.hardening_speed, 1, 1e-14);
    EXPECT_NEAR(ComputeGapBias(mine, gap, h) / c.bias[0], 1, 1e-14);
    EXPECT_NEAR(ComputeGapBias(mine, gap, h) / StopBias(other, gap, h), 1, 1e-14);
  }
  // The defaults are the same numbers.
  EXPECT_EQ(FullContactMaterial{}.stiffness, ContactMaterial{}.stiffness);
  EXPECT_EQ(FullContactMaterial{}.depth, ContactMaterial{}.depth);
  EXPECT_EQ(FullContactMaterial{}.relaxation_steps, ContactMaterial{}.relaxation_steps);
  EXPECT_EQ(FullContactMaterial{}.max_push_speed, ContactMaterial{}.max_push_speed);
  EXPECT_EQ(FullContactOptions{}.tolerance, ContactSolverOptions{}.tolerance);
  EXPECT_EQ(FullContactOptions{}.max_relative_regularization,
            ContactSolverOptions{}.max_relative_regularization);
}

TEST(PointBlock, SolvesTheLawForAnyOperator) {
  std::mt19937 random(7);
  int counts[3] = {0, 0, 0};
  for (int draw = 0; draw < 2000; ++draw) {
    Matrix3 B;
    for (int k = 0; k < 3; ++k) B.col(k) = std::pow(10, Draw(random, -2, 2)) * DrawVector(random);
    const Matrix3 A = B * B.transpose() + 1e-3 * Matrix3::Identity();
    const Vector3 c = DrawVector(random);
    const double friction = draw % 10 == 0 ? 0 : Draw(random, 0, 2), rho = 3 / A.trace();
    const Vector2 shares(1, draw % 2 == 0 ? 1 : Draw(random, 0.1, 1));
    const Vector3 x = SolvePointBlock(A, c, friction, shares);
    const Vector3 metric(1, 1, shares[1] * shares[1]);
    const FrictionProjection at =
        ProjectOntoFrictionCone(x - rho * metric.cwiseProduct(A * x + c), friction, shares);
    EXPECT_LT((x - at.impulse).norm(), 1e-9 * (x.norm() + rho * c.norm())) << draw;
    ++counts[static_cast<int>(at.mode)];
  }
  for (const int count : counts) EXPECT_GT(count, 100);
}

}  // namespace
}  // namespace fork1s::reference
