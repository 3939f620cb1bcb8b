#include <gtest/gtest.h>
#include <fork1s/spatial/screw_motion.hpp>

#include <limits>

#include "oracle.hpp"

namespace fork1s::spatial_test {
namespace {

// Hinges, slides and helices of unit axes, and screws that have none.
TEST(ScrewMotion, IsTheExponential) {
  for (const Vector6& sample : Samples())
    for (const bool unit : {true, false}) {
      Vector6 s = sample;
      if (unit) s.head<3>().stableNormalize();
      const ScrewMotion motion(s);
      for (const double q : {0.0, 1e-8, -1e-6, 0.3, 1.0, 3.14159, -6.0}) {
        RigidTransform X{RigidTransform::Unset()};
        motion.At(q, X);
        EXPECT_LE(Difference(Homogeneous(X), ExpOracle(q * s)), kTolerance * Scale(q * s))
            << s.transpose() << " times " << q;
      }
    }
}

TEST(ScrewMotion, SlidesAlongWhatDoesNotTurn) {
  const Vector3 v(0.1, -2, 3);
  Vector6 s;
  s << Vector3::Zero(), v;
  EXPECT_TRUE(ScrewMotion(s).is_slide());
  EXPECT_FALSE(ScrewMotion(Vector6::UnitX()).is_slide());
  RigidTransform X{RigidTransform::Unset()};
  ScrewMotion(s).At(0.7, X);
  EXPECT_EQ(X.rotation(), Matrix3(Matrix3::Identity()));
  EXPECT_LE((X.translation() - 0.7 * v).norm(), kTolerance);
}

TEST(RigidTransform, IsFiniteAsLongAsAllOfItIs) {
  for (int k = 0; k < 12; ++k)
    for (const double bad :
         {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
          std::numeric_limits<double>::quiet_NaN()}) {
      RigidTransform X(Vector3(1e300, -2, 3));
      EXPECT_TRUE(X.IsFinite());
      X.data()[k] = bad;
      EXPECT_FALSE(X.IsFinite()) << k << " " << bad;
    }
}

// By columns of four numbers that overlap in memory: nothing of one may be left in the next.
TEST(RigidTransform, ProductsAreThoseOfTheMatrices) {
  for (const Vector6& x : Samples())
    for (const Vector6& y : Samples()) {
      const RigidTransform X = Exp(x), Y = Exp(y);
      EXPECT_LE(Difference(Homogeneous(X * Y), Homogeneous(X) * Homogeneous(Y)),
                kTolerance * (Scale(x) + Scale(y)));
    }
}

}  // namespace
}  // namespace fork1s::spatial_test
