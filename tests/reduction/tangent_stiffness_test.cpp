// Compliance and frequencies about loaded equilibria against closed forms and differences of the force.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "mechanisms.hpp"
#include "reduction/tangent_stiffness.hpp"

namespace fork1s {
namespace {

using testing::Share;

constexpr double kGravity = 9.81;

double Hertz(double k, double m) { return std::sqrt(k / m) / (2 * std::numbers::pi); }

// 1.5 kg at 0.4 m above a hinge about y of k N·m/rad.
std::shared_ptr<const Mechanism> Mast(double k) {
  MechanismBuilder builder("mast");
  BodyDef mast;
  mast.name = "mast";
  mast.parent = builder.base();
  mast.inertia = {1.5, Vector3(0, 0, 0.4), 0.002 * Matrix3::Identity()};
  const BodyIndex body = builder.AddBody(mast);
  builder.AddJoint(JointDef::Hinge("foot", body, Vector3::UnitY()).WithSpring(k, 0));
  builder.SetInterfaces({"mast"});
  return Share(builder.definition());
}

StaticsOptions Weight(double g) {
  StaticsOptions options;
  options.gravity_R = Vector3(0, 0, -g);
  return options;
}

TEST(TangentStiffness, MastCarriesItsWeight) {
  const auto m = Mast(10);
  const StaticsOptions options = Weight(kGravity);
  const auto rest = SolveStatics(*m, VectorX::Zero(1), {}, options);
  ASSERT_TRUE(rest.converged);
  const TangentStiffness tangent = ComputeTangentStiffness(*m, rest.q, {}, options);
  const double k = 10 - 1.5 * kGravity * 0.4, inertia = 0.002 + 1.5 * 0.16;
  EXPECT_NEAR(tangent.lowest(), k, 1e-8);
  EXPECT_TRUE(tangent.IsStable());
  const auto hertz = TangentFrequencies(*m, rest.q, tangent);
  ASSERT_EQ(hertz.size(), 1u);
  EXPECT_NEAR(hertz[0], Hertz(k, inertia), 1e-8);
  const BodyIndex body = m->FindBody("mast");
  const MatrixX C = TangentCompliance(*m, rest.q, tangent, {{body, {}}, {body, Vector3(0, 0, 0.5)}}).C;
  EXPECT_NEAR(C(1, 1), 1 / k, 1e-9);
  EXPECT_NEAR(C(9, 9), 0.25 / k, 1e-9);
  EXPECT_NEAR(C(1, 9), 0.5 / k, 1e-9);
}

TEST(TangentStiffness, ATooHeavyMastIsUnstable) {
  const auto m = Mast(5);
  const TangentStiffness tangent = ComputeTangentStiffness(*m, VectorX::Zero(1), {}, Weight(kGravity));
  EXPECT_NEAR(tangent.lowest(), 5 - 1.5 * kGravity * 0.4, 1e-8);
  EXPECT_FALSE(tangent.IsStable());
  EXPECT_TRUE(TangentFrequencies(*m, VectorX::Zero(1), tangent).empty());
}

TEST(TangentStiffness, APendulumHasThatOfItsWeight) {
  const auto m = Mast(0);
  const TangentStiffness tangent = ComputeTangentStiffness(*m, VectorX::Zero(1), {}, Weight(-kGravity));
  EXPECT_NEAR(TangentFrequencies(*m, VectorX::Zero(1), tangent)[0],
              Hertz(1.5 * kGravity * 0.4, 0.002 + 1.5 * 0.16), 1e-8);
  const TangentStiffness nothing = ComputeTangentStiffness(*m, VectorX::Zero(1), {}, Weight(0));
  EXPECT_EQ(nothing.SingularMotions().cols(), 1);
  EXPECT_EQ(TangentCompliance(*m, VectorX::Zero(1), nothing, {{m->FindBody("mast"), {}}}).free.cols(), 1);
}

// The equilibrium under a small load more and less, by Newton's method, against the compliance.
void ExpectDifferencesOfEquilibria(const Mechanism& m, BodyIndex body, const Vector3& dead_force,
                                   const StaticsOptions& options) {
  const auto solve = [&](const Vector3& force) {
    const auto result = SolveStatics(m, VectorX::Zero(m.num_coordinates()), {{body, force}}, options);
    EXPECT_TRUE(result.converged);
    return result.q;
  };
  const auto place = [&](const Vector3& force) {
    Kinematics k(m);
    ComputeKinematics(m, solve(force), k);
    return k.X_RB[body.u()].translation();
  };
  const VectorX q = solve(dead_force);
  const TangentStiffness tangent = ComputeTangentStiffness(m, q, {{body, dead_force}}, options);
  EXPECT_TRUE(tangent.IsStable());
  const MatrixX C = TangentCompliance(m, q, tangent, {{body, {}}}).C;
  ASSERT_EQ(C.rows(), 6);
  const double step = 1e-3 * dead_force.norm();
  for (int i = 0; i < 3; ++i) {
    const Vector3 e = step * Vector3::Unit(i),
                  moved = (place(dead_force + e) - place(dead_force - e)) / (2 * step);
    EXPECT_LT((moved - C.block(3, 3 + i, 3, 1)).norm(), 1e-5 * C.bottomRightCorner(3, 3).norm()) << i;
  }
}

TEST(TangentStiffness, TreesAndLoopsAgreeWithDifferencesOfEquilibria) {
  const auto chain = Share(testing::Chain(6, 0.1, 0.1, 2, 0, true));
  ExpectDifferencesOfEquilibria(*chain, chain->FindBody("tip"), Vector3(-1, 2, 1.5), Weight(kGravity));
  const auto loop = Share(testing::FourBar{}.Definition());
  StaticsOptions options;
  options.gravity_R = Vector3(1, -kGravity, 0);
  ExpectDifferencesOfEquilibria(*loop, loop->FindBody("coupler"), Vector3(3, -2, 0), options);
}

}  // namespace
}  // namespace fork1s
