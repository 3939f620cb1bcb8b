// Stiffness at points of bodies against closed forms, without and under load.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "mechanisms.hpp"
#include "reduction/point_stiffness.hpp"

namespace fork1s {
namespace {

using testing::Share;

// Where a mechanism stands: a hinge about its own y is another axis of the world.
const RigidTransform kFrames[] = {
    RigidTransform(),
    RigidTransform(Matrix3(Eigen::AngleAxisd(0.7, Vector3(1, -2, 0.5).normalized())), Vector3(3, -5, 2))};

struct StandingMast {
  double mass, height, stiffness;

  std::shared_ptr<const Mechanism> Build(const RigidTransform& X_WR) const {
    MechanismBuilder builder("mast");
    BodyDef mast;
    mast.name = "mast";
    mast.parent = builder.base();
    mast.inertia = {mass, Vector3(0, 0, height), 0.002 * Matrix3::Identity()};
    const BodyIndex body = builder.AddBody(mast);
    builder.AddJoint(JointDef::Hinge("foot", body, Vector3::UnitY()).WithSpring(stiffness, 0));
    builder.SetInterfaces({"mast"});
    builder.SetBasePose(X_WR);
    return Share(builder.definition());
  }
};

StaticsOptions Downward(double g) {
  StaticsOptions options;
  options.gravity_R = Vector3(0, 0, -g);
  return options;
}

PointStiffness Loaded(const Mechanism& m, const StaticsOptions& options, const BodyPoint& point) {
  const auto rest = SolveStatics(m, VectorX::Zero(m.num_coordinates()), {}, options);
  EXPECT_TRUE(rest.converged);
  return ComputePointStiffness(m, rest.q, rest.tangent, point);
}

TEST(PointStiffness, MastHasThatOfItsSpringLessThatOfItsWeight) {
  constexpr double kG = 9.81;
  for (const RigidTransform& X : kFrames)
    for (const StandingMast& mast : {StandingMast{1.5, 0.4, 10}, {0.2, 1, 3}, {4, 0.1, 5}}) {
      const auto m = mast.Build(X);
      const Matrix3 R = X.rotation();
      for (const double h : {0.3, 1.0}) {
        const BodyPoint top{m->FindBody("mast"), Vector3(0, 0, h)};
        const PointStiffness springs = ComputeSpringStiffness(*m, VectorX::Zero(1), top),
                             loaded = Loaded(*m, Downward(kG), top);
        const double k = mast.stiffness / (h * h), k_loaded = k - mast.mass * kG * mast.height / (h * h);
        EXPECT_NEAR(springs.Along(R.col(0)), k, 1e-9 * k);
        EXPECT_NEAR(loaded.Along(R.col(0)), k_loaded, 1e-7 * k);
        EXPECT_NEAR(springs.Along(R * Vector3(3, 0, 3)), 2 * k, 1e-9 * k);
        for (const PointStiffness& at : {springs, loaded}) {
          EXPECT_TRUE(std::isinf(at.Along(R.col(1))) && std::isinf(at.Along(R.col(2))));
          EXPECT_TRUE(at.free.empty());
          EXPECT_EQ(at.Stiffness().size(), 0);
        }
        EXPECT_NEAR((R.col(0).transpose() * springs.Compliance().bottomRightCorner(3, 3) * R.col(0)).value(),
                    1 / k, 1e-9 / k);
      }
      const BodyPoint foot{m->FindBody("mast")};
      EXPECT_TRUE(std::isinf(ComputeSpringStiffness(*m, VectorX::Zero(1), foot).Along(R.col(0))));
    }
}

// A mast that is too heavy for its spring leans until k θ = m l (g sin θ + a cos θ), a gravity aside.
TEST(PointStiffness, BuckledMastHasThatOfItsLeaningPose) {
  constexpr double kG = 9.81, kAside = 1;
  for (const RigidTransform& X : kFrames)
    for (const StandingMast& mast : {StandingMast{1, 0.5, 4.4145}, {1.5, 0.4, 5}, {3, 1, 15}}) {
      const auto m = mast.Build(X);
      const double ml = mast.mass * mast.height;
      double turn = 1;
      for (int i = 0; i < 100; ++i)
        turn -= (mast.stiffness * turn - ml * (kG * std::sin(turn) + kAside * std::cos(turn))) /
                (mast.stiffness - ml * (kG * std::cos(turn) - kAside * std::sin(turn)));
      const double k = mast.stiffness - ml * (kG * std::cos(turn) - kAside * std::sin(turn));
      StaticsOptions options = Downward(kG);
      options.gravity_R.x() = kAside;
      const auto rest = SolveStatics(*m, VectorX::Zero(1), {}, options);
      ASSERT_TRUE(rest.converged);
      EXPECT_NEAR(rest.q(0), turn, 1e-8);
      const auto hertz = TangentFrequencies(*m, rest.q, rest.tangent);
      ASSERT_EQ(hertz.size(), 1u);
      const double inertia = 0.002 + ml * mast.height;
      EXPECT_NEAR(hertz[0], std::sqrt(k / inertia) / (2 * M_PI), 1e-7);
      const BodyPoint top{m->FindBody("mast"), Vector3(0, 0, 0.7)};
      const PointStiffness at = ComputePointStiffness(*m, rest.q, rest.tangent, top);
      for (const double angle : {0.0, 0.4, 1.3}) {  // of the direction, from the world's own x of the mast
        const double lever = 0.7 * std::cos(turn - angle);
        const Vector3 d = X.rotation() * Vector3(std::cos(angle), 0, -std::sin(angle));
        EXPECT_NEAR(at.Along(d) * lever * lever, k, 1e-6 * mast.stiffness);
      }
    }
}

// A wheel that turns freely about a strut which a spring of 50 N/m holds along the same axis.
TEST(PointStiffness, AFreeWheelHasNoneAcrossItsSpokesAndThatOfTheStrutAlongItsAxis) {
  for (const RigidTransform& X : kFrames) {
    MechanismBuilder builder("wheel");
    BodyDef strut;
    strut.name = "strut";
    strut.parent = builder.base();
    strut.inertia = testing::Ball(1, 0.1);
    const BodyIndex on = builder.AddBody(strut);
    builder.AddJoint(JointDef::Slide("travel", on, Vector3::UnitZ()).WithSpring(50));
    BodyDef wheel = strut;
    wheel.name = "wheel";
    wheel.parent = on;
    const BodyIndex body = builder.AddBody(wheel);
    builder.AddJoint(JointDef::Hinge("axle", body, Vector3::UnitZ()));
    builder.SetInterfaces({"wheel"});
    builder.SetBasePose(X);
    const auto m = Share(builder.definition());
    const Matrix3 R = X.rotation();
    const BodyPoint hub{body}, rim{body, Vector3(0.2, 0, 0.1)};
    const auto both = [&](const BodyPoint& point) {
      return std::array{ComputeSpringStiffness(*m, VectorX::Zero(2), point), Loaded(*m, {}, point)};
    };
    for (const PointStiffness& at : both(hub)) {
      EXPECT_NEAR(at.Along(R.col(2)), 50, 1e-7);
      EXPECT_TRUE(std::isinf(at.Along(R.col(0))) && std::isinf(at.Along(R.col(1))));
      EXPECT_TRUE(at.free.empty());
      EXPECT_EQ(at.Compliance().size(), 0);  // the body turns
    }
    for (const PointStiffness& at : both(rim)) {
      EXPECT_NEAR(at.Along(R.col(2)), 50, 1e-7);
      EXPECT_TRUE(std::isinf(at.Along(R.col(0))));
      EXPECT_EQ(at.Along(R.col(1)), 0);
      EXPECT_EQ(at.Along(R * Vector3(0, 1, 1)), 0);
      ASSERT_EQ(at.free.size(), 1u);
      EXPECT_NE(at.free[0].find("'axle'"), std::string::npos) << at.free[0];
    }
    const PointStiffness locked = ComputeSpringStiffness(*m, VectorX::Zero(2), rim, {1});
    EXPECT_TRUE(std::isinf(locked.Along(R.col(1))));
    EXPECT_TRUE(locked.free.empty());
  }
}

// Without load both methods have the same, of trees and of loops.
TEST(PointStiffness, SpringsAndTangentAgreeWithoutLoad) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-0.2, 0.2);
  const std::pair<MechanismDef, const char*> models[] = {{testing::Chain(6, 0.1, 0.1, 2, 0, true), "tip"},
                                                         {testing::FourBar{}.Definition(), "coupler"}};
  for (auto [definition, name] : models)
    for (const RigidTransform& X : kFrames) {
      definition.X_WR = X;
      const auto m = Share(definition);
      for (int i = 0; i < 10; ++i) {
        const BodyPoint point{m->FindBody(name), Vector3(any(random), any(random), any(random))};
        const PointStiffness springs = ComputeSpringStiffness(*m, VectorX::Zero(m->num_coordinates()), point),
                             loaded = Loaded(*m, {}, point);
        for (int k = 0; k < 3; ++k) {
          const Vector3 d(any(random), any(random), any(random));
          EXPECT_NEAR(springs.Along(d) / loaded.Along(d), 1, 1e-6);
        }
      }
    }
}

}  // namespace
}  // namespace fork1s
