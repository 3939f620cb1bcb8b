#include "oracle.hpp"

#include <gtest/gtest.h>

namespace fork1s::spatial_test {
namespace {

// Rotations up to 6 rad: joints may turn past half a turn, and Exp must follow them.
constexpr double kLargest = 6.0;

TEST(Exp, IsTheMatrixExponential) {
  for (const Vector6& x : Samples(kLargest))
    EXPECT_LE(Difference(Homogeneous(Exp(x)), ExpOracle(x)), kTolerance * Scale(x)) << x.transpose();
}

TEST(Exp, KeepsTheDigitsOfSmallTwists) {
  // The entries off the diagonal are of the size of x and must be right relative to it. The second order
  // adds x² ~ 1e-12 at 1e-6, which the oracle has too.
  for (const Vector6& x : Samples()) {
    const double angle = x.head<3>().norm();
    if (angle > 1e-3) continue;
    const Matrix3 R = ExpRotation(x.head<3>());
    const MatrixL<4> oracle = ExpOracle(x);
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3;
      EXPECT_NEAR(R(i, j), static_cast<double>(oracle(i, j)), kTolerance * angle) << x.transpose();
    }
  }
}

TEST(Exp, RotationsAreRotations) {
  for (const Vector6& x : Samples(kLargest)) {
    const Matrix3 R = ExpRotation(x.head<3>());
    EXPECT_LE(Difference(Matrix3(R * R.transpose()), Matrix3(Matrix3::Identity())), kTolerance);
    EXPECT_NEAR(R.determinant(), 1, kTolerance);
    EXPECT_LE(Difference(R, Exp(x).rotation()), kTolerance);
  }
}

TEST(Exp, OfTheNegativeIsTheInverse) {
  for (const Vector6& x : Samples(kLargest)) {
    const RigidTransform I = Exp(x) * Exp(-x);
    EXPECT_LE(Difference(Homogeneous(I), Homogeneous(RigidTransform())), kTolerance * Scale(x));
  }
}

TEST(Exp, AddsUpAlongOneScrew) {
  for (const Vector6& x : Samples(kLargest))
    EXPECT_LE(Difference(Homogeneous(Exp(0.3 * x) * Exp(0.7 * x)), Homogeneous(Exp(x))),
              kTolerance * Scale(x));
}

TEST(Log, IsTheMatrixLogarithm) {
  for (const Vector6& x : Samples()) {
    const double angle = x.head<3>().norm();
    if (angle < 1e-12) continue;  // the oracle's digits are absolute, not relative
    const RigidTransform X = Exp(x);
    const MatrixL<4> oracle = Logarithm<4>(Homogeneous(X));
    // The oracle also takes the part of X that rounding (1e-16) made not orthogonal, and two eigenvalues that
    // are 2(π - θ) apart across its cut magnify that part.
    const double tolerance = kTolerance + 1e-15 / (kPi - angle);
    EXPECT_LE(Difference(Hat(Log(X)), oracle), tolerance * Scale(x)) << x.transpose();
  }
}

TEST(Log, UndoesExp) {
  for (const Vector6& x : Samples()) {
    const double angle = x.head<3>().norm();
    const Vector6 y = Log(Exp(x));
    // Small rotations keep their relative digits. Near π the rotation's entries know the axis and the angle
    // to rounding, so nothing is lost there either. (Squares of angles below 1e-154 underflow; by then a
    // rotation is none.)
    const double small = angle < 1e-150 ? 1e-150 : kTolerance * angle;
    EXPECT_LE((y - x).head<3>().norm(), small) << x.transpose();
    EXPECT_LE((y - x).tail<3>().norm(), kTolerance * Scale(x)) << x.transpose();
  }
}

TEST(Log, IsUndoneByExp) {
  Random random(5);
  for (double d : {0.0, 1e-16, 1e-12, 1e-8, 1e-6, 1e-3})
    for (int sign : {-1, 1})
      for (int i = 0; i < 30; ++i) {
        const Vector3 axis = i < 3 ? Vector3(Vector3::Unit(i)) : random.Direction();
        Vector6 x;
        x << (kPi + sign * d) * axis, random.InBox(1);
        const RigidTransform X = Exp(x);
        const Vector6 y = Log(X);
        EXPECT_LE(y.head<3>().norm(), kPi * (1 + 1e-15));
        EXPECT_LE(Difference(Homogeneous(Exp(y)), Homogeneous(X)), 2 * kTolerance) << x.transpose();
      }
}

TEST(Log, OfHalfTurnsIsExact) {
  for (int i = 0; i < 3; ++i) {
    Matrix3 R = -Matrix3::Identity();
    R(i, i) = 1;
    const Vector3 w = LogRotation(R);
    EXPECT_NEAR(std::abs(w(i)), kPi, 1e-15);
    EXPECT_EQ(w.squaredNorm(), w(i) * w(i));
  }
  EXPECT_EQ(Log(RigidTransform::Identity()), Vector6(Vector6::Zero()));
}

TEST(Log, StandsRotationsThatDriftedByRounding) {
  // Products of many poses leave the orthogonal group by some 1e-15; the log must not notice.
  Random random(6);
  for (double angle : HardAngles()) {
    if (angle < 1e-9) continue;
    const Vector3 w = angle * random.Direction();
    Matrix3 R = ExpRotation(w);
    for (int i = 0; i < 9; ++i) R(i / 3, i % 3) += random.Uniform(-1e-15, 1e-15);
    EXPECT_LE((LogRotation(R) - w).norm(), kTolerance) << angle;
  }
}

TEST(Dexp, IsTheSeriesOfTheSmallAdjoint) {
  for (const Vector6& x : Samples(kLargest)) {
    const MatrixL<6> oracle = DexpOracle<6>(SmallAdjointOracle(x));
    EXPECT_LE(Difference(Dexp(x), oracle), kTolerance * Scale(x)) << x.transpose();
  }
}

TEST(Dexp, RotationIsTheSeriesOfTheCrossProduct) {
  for (const Vector6& x : Samples(kLargest)) {
    const MatrixL<3> oracle = DexpOracle<3>(Skew(x.head<3>()).cast<Real>());
    EXPECT_LE(Difference(DexpRotation(x.head<3>()), oracle), kTolerance) << x.transpose();
    EXPECT_LE(Difference(Matrix3(Dexp(x).topLeftCorner<3, 3>()), oracle), kTolerance);
  }
}

TEST(Dexp, IsTheDerivativeOfExp) {
  // d/dt Exp(x + t y) Exp(x)⁻¹ by fourth-order differences: h⁴/30 ~ 3e-14 of truncation at h = 1e-3 against
  // 1e-16/h = 1e-13 of rounding, both times the pose's size.
  Random random(7);
  const double h = 1e-3;
  for (const Vector6& x : Samples(kLargest)) {
    Vector6 y;
    y << random.Direction(), random.Direction();
    auto f = [&](double t) { return MatrixL<4>(Homogeneous(Exp(x + t * y))); };
    const MatrixL<4> slope = (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * Real(h));
    const MatrixL<4> V = slope * Homogeneous(Exp(x).inverse());
    EXPECT_LE(Difference(V, Hat(Dexp(x) * y)), 2e-11 * Scale(x)) << x.transpose();
  }
}

TEST(Dexp, InverseIsItsInverse) {
  // The coupling block of the inverse is a product of three blocks, so it may grow with the translation
  // twice.
  for (const Vector6& x : Samples()) {
    const Matrix6 I = Matrix6::Identity();
    const double tolerance = 2 * kTolerance * Scale(x);
    EXPECT_LE(Difference(Matrix6(Dexp(x) * DexpInverse(x)), I), tolerance) << x.transpose();
    EXPECT_LE(Difference(Matrix6(DexpInverse(x) * Dexp(x)), I), tolerance) << x.transpose();
    const Vector3 w = x.head<3>();
    EXPECT_LE(Difference(Matrix3(DexpRotation(w) * DexpInverseRotation(w)), Matrix3(Matrix3::Identity())),
              kTolerance);
  }
}

TEST(Dexp, InverseMatchesTheOracle) {
  for (const Vector6& x : Samples()) {
    const MatrixL<6> oracle = Inverse<6>(DexpOracle<6>(SmallAdjointOracle(x)));
    EXPECT_LE(Difference(DexpInverse(x), oracle), 2 * kTolerance * Scale(x)) << x.transpose();
  }
}

TEST(Dexp, LeftAndRightDifferByTheAdjoint) {
  // Dexp(x) = Ad(Exp x) Dexp(-x)
  for (const Vector6& x : Samples(kLargest))
    EXPECT_LE(Difference(Dexp(x), Matrix6(Adjoint(Exp(x)) * Dexp(-x))), 3 * kTolerance * Scale(x));
}

TEST(Dexp, LeavesItsOwnScrewAlone) {
  for (const Vector6& x : Samples(kLargest)) EXPECT_LE((Dexp(x) * x - x).norm(), 10 * kTolerance * Scale(x));
}

}  // namespace
}  // namespace fork1s::spatial_test
