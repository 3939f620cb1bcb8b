// Every law by itself: projections, derivatives, energies and violations at scales from 1e-6 to 1e6.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "constraints/laws/friction_cone.hpp"
#include "constraints/laws/moment_bounds.hpp"
#include "problems.hpp"

namespace fork1s::internal {
namespace {

using testing::Uniform;

constexpr double kScales[] = {1e-6, 1e-3, 1, 1e3, 1e6};  // of impulses [N·s]
constexpr double kStep = 1e-6;                           // of a finite difference, relative to the scale
constexpr double kAway = 1e-4;                           // from the edges of modes, likewise

FrictionCone DrawCone(std::mt19937& random, double scale) {
  FrictionCone law;
  law.R_n = std::pow(10, Uniform(random, -3, 3)) / scale;
  law.R_t = law.R_n * std::pow(10, Uniform(random, -1, 1));
  law.coefficient = Uniform(random, 0, 1.5);
  return law;
}

Vector3 DrawVector(std::mt19937& random, double size) {
  return size * Vector3(Uniform(random, -0.3, 1), Uniform(random, -1, 1), Uniform(random, -1, 1));
}

bool IsNearEdge(const FrictionCone& law, const Vector3& y, double scale) {
  const double bound = law.Bound(law.BoundingNormal(y[0]));
  return std::abs(y[0]) < kAway * scale || std::abs(y.tail<2>().norm() - bound) < kAway * scale ||
         y.tail<2>().norm() < 0.05 * scale;
}

/// Draws of a cone, its bound following the normal and frozen, and of y.
template <class Check>
void ForCones(const Check& check) {
  std::mt19937 random(1);
  for (const double scale : kScales)
    for (int draw = 0; draw < 200; ++draw) {
      FrictionCone law = DrawCone(random, scale);
      if (draw % 2 == 1) law.frozen_normal = scale * Uniform(random, 0, 1);
      check(law, DrawVector(random, scale), scale);
    }
}

BoundLaw DrawBounds(std::mt19937& random, double scale, int draw) {
  BoundLaw law;
  law.R = std::pow(10, Uniform(random, -3, 3)) / scale;
  if (draw % 3 == 1) law.upper = scale * Uniform(random, 0, 1);
  if (draw % 3 == 2) law.lower = -(law.upper = scale * Uniform(random, 0, 1));
  return law;
}

template <class Check>
void ForBounds(const Check& check) {
  std::mt19937 random(2);
  for (const double scale : kScales)
    for (int draw = 0; draw < 300; ++draw) {
      const BoundLaw law = DrawBounds(random, scale, draw);
      check(law, scale * Uniform(random, -1.5, 1.5), scale);
    }
}

TEST(FrictionCone, ProjectionIsAdmissibleAndIdempotent) {
  ForCones([](const FrictionCone& law, const Vector3& y, double scale) {
    const Vector3 impulse = law.Project(y);
    EXPECT_GE(impulse[0], 0);
    EXPECT_LE(impulse.tail<2>().norm(), law.Bound(law.BoundingNormal(impulse[0])) + 1e-15 * scale);
    EXPECT_LT((law.Project(impulse) - impulse).norm(), 1e-15 * scale);
  });
}

TEST(FrictionCone, DerivativeMatchesFiniteDifferences) {
  int counts[3] = {0, 0, 0};
  ForCones([&](const FrictionCone& law, const Vector3& y, double scale) {
    if (IsNearEdge(law, y, scale)) return;
    Matrix3 differences;
    for (int k = 0; k < 3; ++k) {
      const Vector3 step = kStep * scale * Vector3::Unit(k);
      differences.col(k) = (law.Project(y + step) - law.Project(y - step)) / (2 * kStep * scale);
    }
    EXPECT_LT((differences - law.Derivative(y)).norm(), 1e-7);
    ++counts[static_cast<int>(law.ModeOf(law.At(y[0], y.tail<2>(), 0)))];
  });
  for (const int count : counts) EXPECT_GT(count, 50);
}

// What slips by u opens by δ µ |u|; without dilatancy it is Coulomb's law, with δ = 1 the gradient of a convex function.
TEST(FrictionCone, DilatantLaw_OpensByItsShareOfTheSlip) {
  std::mt19937 random(5);
  int counts[3] = {0, 0, 0};
  for (const double scale : kScales)
    for (int draw = 0; draw < 600; ++draw) {
      FrictionCone law = DrawCone(random, scale);
      law.dilatancy = draw % 3 == 0 ? 1 : draw % 3 == 1 ? Uniform(random, 0, 1) : 0;
      const Vector3 y = DrawVector(random, scale), w = -Vector3(law.R_n, law.R_t, law.R_t).cwiseProduct(y);
      Vector3 impulse;
      Matrix3 D;
      const ContactMode mode = law.ProjectDilatant(w, impulse, &D);
      ++counts[static_cast<int>(mode)];
      EXPECT_GE(impulse[0], 0);
      const Vector2 slip = w.tail<2>() + law.R_t * impulse.tail<2>();
      if (mode == ContactMode::kSliding) {
        const double R = std::max(law.R_n, law.R_t);
        EXPECT_NEAR(w[0] + law.R_n * impulse[0], law.dilatancy * law.coefficient * slip.norm(),
                    1e-12 * R * scale);
        EXPECT_NEAR(impulse.tail<2>().norm(), law.coefficient * impulse[0], 1e-12 * scale);
        EXPECT_NEAR(impulse.tail<2>().dot(slip), -impulse.tail<2>().norm() * slip.norm(),
                    1e-11 * R * scale * scale);
      }
      if (mode == ContactMode::kSticking) {
        EXPECT_LT(slip.norm(), 1e-12 * law.R_t * scale);
      }
      if (law.dilatancy == 0 && !IsNearEdge(law, y, scale)) {
        EXPECT_LT((impulse - law.Project(y)).norm(), 1e-12 * scale);
      }
      if (law.dilatancy == 1) {
        EXPECT_LE((D - D.transpose()).norm(), 1e-12 * D.norm());
      }
      Matrix3 differences;
      bool same = true;
      for (int k = 0; k < 3; ++k) {
        const Vector3 step = kStep * law.R_t * scale * Vector3::Unit(k);
        Vector3 before, after;
        same = same && law.ProjectDilatant(w - step, before, nullptr) == mode &&
               law.ProjectDilatant(w + step, after, nullptr) == mode;
        differences.col(k) = (before - after) / (2 * kStep * law.R_t * scale);
      }
      if (same && y.tail<2>().norm() > 0.05 * scale) {
        EXPECT_LT((differences - D).norm(), 1e-6 * (D.norm() + 1 / law.R_t));
      }
    }
  for (const int count : counts) EXPECT_GT(count, 50);
}

// λ = −D w of a mode is Newton's step on λ = Π(λ − ρ (w + R λ)): D = (1 − Π' (1 − ρ R))⁻¹ Π' ρ.
TEST(FrictionCone, LinearizationSolvesTheDerivativeOfTheNaturalMap) {
  std::mt19937 random(3);
  ForCones([&](const FrictionCone& law, const Vector3& y, double scale) {
    if (IsNearEdge(law, y, scale) || (y[0] < 0 && !law.IsFrozen())) return;
    const double inverse_mass = law.R_n * std::pow(10, Uniform(random, -3, 3));
    const Vector3 R(law.R_n, law.R_t, law.R_t), rho = (R.array() + inverse_mass).inverse();
    const FrictionCone::Trial trial = law.At(y[0], y.tail<2>(), rho[1]);
    Matrix3 D;
    law.Linearize(trial, trial.Slides(), D);
    const Matrix3 slope = law.Derivative(y);
    const Vector3 left = 1 - rho.array() * R.array();
    const Matrix3 natural = Matrix3::Identity() - slope * left.asDiagonal();
    EXPECT_LT((natural * D - slope * rho.asDiagonal()).norm(), 1e-10 * (slope * rho.asDiagonal()).norm());
  });
}

TEST(FrictionCone, EnergyOfAFrozenBoundHasTheProjectionForItsGradient) {
  ForCones([](FrictionCone law, const Vector3& y, double scale) {
    if (IsNearEdge(law, y, scale)) return;
    law.frozen_normal = law.BoundingNormal(y[0]);
    const Vector3 R(law.R_n, law.R_t, law.R_t);
    Vector3 gradient;
    for (int k = 0; k < 3; ++k) {
      const Vector3 step = kAway * scale * Vector3::Unit(k);
      gradient[k] = (law.Energy(y + step) - law.Energy(y - step)) / (2 * kAway * scale);
    }
    EXPECT_LT((gradient.cwiseQuotient(R) - law.Project(y)).norm(), 1e-6 * scale);
  });
}

TEST(FrictionCone, ViolationVanishesAtSolutionsOnly) {
  ForCones([](const FrictionCone& law, const Vector3& w, double scale) {
    const Vector3 velocity = -w.cwiseProduct(Vector3(law.R_n, law.R_t, law.R_t));
    const Vector3 impulse = law.Project(law.AtVelocity(velocity));
    EXPECT_EQ(law.Violation(impulse, velocity), Vector3::Zero());
    const Vector3 off = 0.1 * scale * Vector3(1, -1, 1);
    EXPECT_LT((law.Violation(impulse + off, velocity) - off).norm(), 1e-14 * scale);
    if (law.IsFrozen()) return;
    // The natural map has the same solutions for any inverse mass.
    for (const double inverse_mass : {0.1 * law.R_n, 10 * law.R_n}) {
      const double normal = law.TrialNormal(impulse[0], velocity[0], inverse_mass);
      const Vector3 natural = law.Project(law.NaturalTrial(normal, impulse, velocity, inverse_mass));
      EXPECT_LT((natural - impulse).norm(), 1e-13 * scale);
    }
  });
}

TEST(FrictionCone, SlipOpposesFrictionAndDissipates) {
  ForCones([](const FrictionCone& law, const Vector3& y, double scale) {
    const Vector3 R(law.R_n, law.R_t, law.R_t), velocity = -y.cwiseProduct(R);
    const Vector3 impulse = law.Project(y), slip = velocity + impulse.cwiseProduct(R);
    EXPECT_LE(impulse.tail<2>().dot(slip.tail<2>()), 1e-13 * R[1] * scale * scale);
    if (impulse.tail<2>().norm() < law.Bound(law.BoundingNormal(impulse[0])) * (1 - 1e-12)) {
      EXPECT_LT(slip.tail<2>().norm(), 1e-13 * R[1] * scale);
    }
  });
}

TEST(BoundLaw, ProjectionIsAdmissibleAndIdempotent) {
  ForBounds([](const BoundLaw& law, double y, double) {
    const double impulse = law.Project(y);
    EXPECT_TRUE(impulse >= law.lower && impulse <= law.upper);
    EXPECT_EQ(law.Project(impulse), impulse);
  });
}

TEST(BoundLaw, DerivativeAndEnergyMatchFiniteDifferences) {
  int inside = 0, outside = 0;
  ForBounds([&](const BoundLaw& law, double y, double scale) {
    if (std::abs(y - law.lower) < kAway * scale || std::abs(y - law.upper) < kAway * scale) return;
    const double step = 0.1 * kAway * scale;
    EXPECT_NEAR(law.Derivative(y), (law.Project(y + step) - law.Project(y - step)) / (2 * step), 1e-8);
    EXPECT_NEAR(law.Project(y), (law.Energy(y + step) - law.Energy(y - step)) / (2 * step) / law.R,
                1e-8 * scale);
    ++(law.IsWithin(y) ? inside : outside);
  });
  EXPECT_GT(inside, 100);
  EXPECT_GT(outside, 100);
}

TEST(BoundLaw, ViolationVanishesAtSolutionsOnly) {
  ForBounds([](const BoundLaw& law, double y, double scale) {
    const double w = -y * law.R, impulse = law.Project(-w / law.R);
    EXPECT_EQ(law.Violation(impulse, w), 0);
    EXPECT_NEAR(law.Violation(impulse + scale, w), scale, 1e-14 * scale);
    for (const double inverse_mass : {0.1 * law.R, 10 * law.R})
      EXPECT_NEAR(law.Project(law.Trial(impulse, w, inverse_mass)), impulse, 1e-13 * scale);
  });
}

TEST(MomentBounds, DerivativesMatchFiniteDifferences) {
  std::mt19937 random(4);
  int at_bound = 0;
  for (const double scale : kScales)
    for (int draw = 0; draw < 200; ++draw) {
      MomentBounds law;
      law.radius = 0.1 * Vector3(1, 2, 3);
      law.R.setConstant(1 / scale);
      law.share = Uniform(random, 0.1, 1);
      const int axis = draw % 3;
      const double normal = scale * Uniform(random, 0.1, 1), y = scale * Uniform(random, -0.3, 0.3);
      const BoundLaw bounds = law.At(axis, normal);
      if (std::abs(std::abs(y) - bounds.upper) < kAway * scale) continue;
      const auto moment = [&](double share, double more) {
        MomentBounds other = law;
        other.share = share;
        return other.At(axis, normal + more).Project(y);
      };
      const double step = kStep * scale;
      const bool is_within = bounds.IsWithin(y);
      at_bound += is_within ? 0 : 1;
      EXPECT_NEAR(is_within ? 0 : law.ByNormal(axis, y),
                  (moment(law.share, step) - moment(law.share, -step)) / (2 * step), 1e-8);
      EXPECT_NEAR(is_within ? 0 : law.ByShare(axis, y, normal),
                  (moment(law.share + kStep, 0) - moment(law.share - kStep, 0)) / (2 * kStep), 1e-8 * scale);
    }
  EXPECT_GT(at_bound, 100);
}

}  // namespace
}  // namespace fork1s::internal
