#include "spatial/roll_pitch_yaw.hpp"

#include <cmath>

#include "oracle.hpp"

#include <gtest/gtest.h>

namespace fork1s::spatial_test {
namespace {

TEST(RollPitchYaw, TurnsAboutTheFixedAxes_OneAfterTheOther) {
  for (const Vector6& x : Samples(3.0)) {
    const double roll = x[0], pitch = x[1], yaw = x[2];
    Matrix3 X, Y, Z;
    X << 1, 0, 0, 0, std::cos(roll), -std::sin(roll), 0, std::sin(roll), std::cos(roll);
    Y << std::cos(pitch), 0, std::sin(pitch), 0, 1, 0, -std::sin(pitch), 0, std::cos(pitch);
    Z << std::cos(yaw), -std::sin(yaw), 0, std::sin(yaw), std::cos(yaw), 0, 0, 0, 1;
    EXPECT_LE(Difference(RollPitchYawRotation({roll, pitch, yaw}), Matrix3(Z * Y * X)), kTolerance);
  }
}

}  // namespace
}  // namespace fork1s::spatial_test
