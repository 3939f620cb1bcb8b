#include "oracle.hpp"

#include <gtest/gtest.h>
#include <fork1s/spatial/spatial_inertia.hpp>
#include <fork1s/spatial/twist.hpp>

namespace fork1s::spatial_test {
namespace {

Vector6 RandomSix(Random& random, double half) {
  Vector6 x;
  x << random.InBox(half), random.InBox(half);
  return x;
}

SpatialInertia RandomInertia(Random& random) {
  const Matrix3 R = ExpRotation(random.InBox(3));
  SpatialInertia I;
  I.mass = random.Uniform(0.1, 3);
  I.center = random.InBox(0.5);
  I.rotational =
      R * Vector3(random.Uniform(0.01, 1), random.Uniform(0.01, 1), random.Uniform(0.01, 1)).asDiagonal() *
      R.transpose();
  return I;
}

TEST(RigidTransform, GroupLaws) {
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const RigidTransform A = Exp(RandomSix(random, 3)), B = Exp(RandomSix(random, 3));
    const Vector3 p = random.InBox(2);
    // Poses here are at most 10 m away, so products round to 1e-15 * 10 * a few.
    EXPECT_LE(Difference(Homogeneous(A * B), MatrixL<4>(Homogeneous(A) * Homogeneous(B))), kTolerance);
    EXPECT_LE(Difference(Homogeneous(A.inverse()), MatrixL<4>(Homogeneous(A).inverse())), kTolerance);
    EXPECT_LE(((A * B) * p - A * (B * p)).norm(), kTolerance);
    EXPECT_LE((A.inverse() * (A * p) - p).norm(), kTolerance);
    const RigidTransform C(A.quaternion(), A.translation());
    EXPECT_LE(Difference(Homogeneous(C), Homogeneous(A)), kTolerance);
  }
}

TEST(RigidTransform, OrthonormalizeRepairsAndKeeps) {
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    const RigidTransform exact = Exp(RandomSix(random, 3));
    RigidTransform X = exact;
    for (int k = 0; k < 9; ++k) X.rotation()(k / 3, k % 3) += random.Uniform(-1e-9, 1e-9);
    X.Orthonormalize();
    EXPECT_LE(Difference(Matrix3(X.rotation() * X.rotation().transpose()), Matrix3(Matrix3::Identity())),
              kTolerance);
    EXPECT_LE(Difference(X.rotation(), exact.rotation()), 1e-8);  // no farther than it had drifted
  }
}

TEST(RigidTransform, KnowsWhatIsNotFinite) {
  EXPECT_TRUE(RigidTransform().IsFinite());
  EXPECT_FALSE(RigidTransform(Vector3(0, NAN, 0)).IsFinite());
  RigidTransform X;
  X.rotation()(1, 2) = INFINITY;
  EXPECT_FALSE(X.IsFinite());
}

TEST(Adjoint, IsConjugation) {
  // [Ad(X) y] = X [y] X⁻¹, on 4x4 matrices.
  Random random(3);
  for (const Vector6& x : Samples()) {
    const RigidTransform X = Exp(x);
    const Vector6 y = RandomSix(random, 1);
    const MatrixL<4> oracle = Homogeneous(X) * Hat(y) * Inverse<4>(Homogeneous(X));
    EXPECT_LE(Difference(Hat(Adjoint(X) * y), oracle), 2 * kTolerance * Scale(x)) << x.transpose();
    EXPECT_LE((AdjointApply(X, y) - Adjoint(X) * y).norm(), kTolerance * Scale(x));
    EXPECT_LE((AdjointTransposeApply(X, y) - Adjoint(X).transpose() * y).norm(), kTolerance * Scale(x));
  }
}

TEST(Adjoint, OfAProductIsTheProduct) {
  Random random(4);
  for (const Vector6& x : Samples()) {
    const RigidTransform X = Exp(x), Y = Exp(RandomSix(random, 1));
    EXPECT_LE(Difference(Adjoint(X * Y), Matrix6(Adjoint(X) * Adjoint(Y))), 2 * kTolerance * Scale(x));
    EXPECT_LE(Difference(Matrix6(Adjoint(X) * Adjoint(X.inverse())), Matrix6(Matrix6::Identity())),
              2 * kTolerance * Scale(x));
  }
}

TEST(Adjoint, OfExpIsTheExponentialOfTheSmallAdjoint) {
  for (const Vector6& x : Samples(6.0)) {
    const MatrixL<6> oracle = Exponential<6>(SmallAdjointOracle(x));
    EXPECT_LE(Difference(Adjoint(Exp(x)), oracle), 2 * kTolerance * Scale(x)) << x.transpose();
  }
}

TEST(Adjoint, KeepsPower) {
  Random random(8);
  for (int i = 0; i < 100; ++i) {
    const RigidTransform X = Exp(RandomSix(random, 3));
    const Vector6 V_B = RandomSix(random, 2), F_A = RandomSix(random, 2);
    const Twist V_A(AdjointApply(X, V_B));
    const Wrench F_B(AdjointTransposeApply(X, F_A));
    EXPECT_NEAR(Power(Wrench(F_A), V_A), Power(F_B, Twist(V_B)), 10 * kTolerance);  // terms of size 4 * 10 m
  }
}

TEST(Bracket, IsTheCommutator) {
  Random random(9);
  for (int i = 0; i < 100; ++i) {
    const Vector6 x = RandomSix(random, 2), y = RandomSix(random, 2), z = RandomSix(random, 2);
    EXPECT_LE(Difference(SmallAdjoint(x), SmallAdjointOracle(x)), 0);  // entries are copied
    EXPECT_LE((Bracket(x, y) - SmallAdjoint(x) * y).norm(), kTolerance);
    EXPECT_LE((Bracket(x, y) + Bracket(y, x)).norm(), kTolerance);
    const Vector6 jacobi = Bracket(x, Bracket(y, z)) + Bracket(y, Bracket(z, x)) + Bracket(z, Bracket(x, y));
    EXPECT_LE(jacobi.norm(), kTolerance * 10);  // terms of size 2³
    const RigidTransform X = Exp(z);
    EXPECT_LE((AdjointApply(X, Bracket(x, y)) - Bracket(AdjointApply(X, x), AdjointApply(X, y))).norm(),
              kTolerance * 100);  // products of twists of length 10
  }
}

TEST(SpatialInertia, TransformIsACongruence) {
  // I_A = Ad(X_AB)⁻ᵀ I_B Ad(X_AB)⁻¹
  Random random(10);
  for (const Vector6& x : Samples()) {
    const SpatialInertia I = RandomInertia(random);
    const RigidTransform X = Exp(x);
    const Matrix6 Ad = Adjoint(X.inverse());
    const Matrix6 congruence = Ad.transpose() * I.Matrix() * Ad;
    // Rotational entries grow with the square of the distance.
    EXPECT_LE(Difference(Transform(X, I).Matrix(), congruence), 10 * kTolerance * Scale(x) * Scale(x));
  }
}

TEST(SpatialInertia, MatrixGivesTheKineticEnergyOfPointMasses) {
  Random random(11);
  for (int i = 0; i < 50; ++i) {
    SpatialInertia I;
    std::vector<std::pair<double, Vector3>> points;
    Vector3 moment = Vector3::Zero();
    for (int k = 0; k < 5; ++k) {
      points.emplace_back(random.Uniform(0.1, 1), random.InBox(1));
      I.mass += points.back().first;
      moment += points.back().first * points.back().second;
    }
    I.center = moment / I.mass;
    for (const auto& [m, p] : points) {
      const Matrix3 r = Skew(p - I.center);
      I.rotational -= m * r * r;
    }
    const Vector6 V = RandomSix(random, 2);
    double twice_energy = 0;
    for (const auto& [m, p] : points) twice_energy += m * (V.tail<3>() + V.head<3>().cross(p)).squaredNorm();
    EXPECT_NEAR(V.dot(I.Matrix() * V), twice_energy, kTolerance * twice_energy);
  }
}

TEST(Twist, AddsAndScales) {
  const Twist a(Vector3(1, 2, 3), Vector3(4, 5, 6));
  Twist b = a + 2.0 * a - a;
  EXPECT_EQ(b.angular(), Vector3(2, 4, 6));
  b += a;
  EXPECT_EQ(b.linear(), Vector3(12, 15, 18));
  EXPECT_EQ(Power(Wrench(Vector3::UnitX(), Vector3::UnitZ()), a), 7);
}

}  // namespace
}  // namespace fork1s::spatial_test
