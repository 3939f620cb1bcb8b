// The stiffness of a tendon's servo that is set, against the file with that kp.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/continue.hpp>

#include "helpers.hpp"

namespace fork1s::testing_importer {
namespace {

ImportedScene LoadFingerOfStiffness(double kp, double kv) {
  return MustLoad(fmt::format(
      R"(<mujoco><compiler angle="radian"/><worldbody><body><joint name="a" axis="0 1 0" stiffness=".1"/><geom size=".1"/>
    <body pos=".5 0 0"><joint name="b" axis="0 1 0"/><geom size=".1"/></body></body></worldbody>
    <tendon><fixed name="t"><joint joint="a" coef="1"/><joint joint="b" coef="2"/></fixed></tendon>
    <actuator><general name="grip" tendon="t" biastype="affine" gainprm="{}" biasprm="0 -{} -{}" ctrlrange="0 255"
      forcerange="-5 5"/></actuator></mujoco>)",
      0.003 * kp, kp, kv));
}

TEST(SetStiffness, OfAServoOfATendon_IsThatOfTheFile) {
  const ImportedScene soft = LoadFingerOfStiffness(10, 0.5), stiff = LoadFingerOfStiffness(40, 1);
  auto changed = WithStiffness(soft.scene, "grip", 40);
  ASSERT_TRUE(changed) << changed.error().Text();
  const MechanismDef &ours = changed->mechanisms[0], &wanted = stiff.scene.mechanisms[0];
  ASSERT_EQ(ours.springs.size(), 1u);
  EXPECT_DOUBLE_EQ(ours.springs[0].stiffness, wanted.springs[0].stiffness);
  EXPECT_DOUBLE_EQ(ours.springs[0].damping, wanted.springs[0].damping);
  EXPECT_DOUBLE_EQ(ours.springs[0].rest, wanted.springs[0].rest);
  ASSERT_EQ(ours.force_limits.size(), 1u);
  EXPECT_DOUBLE_EQ(ours.force_limits[0].stiffness, wanted.force_limits[0].stiffness);
  EXPECT_DOUBLE_EQ(ours.force_limits[0].damping, wanted.force_limits[0].damping);
  EXPECT_EQ(ours.force_limits[0].upper, 5);
  EXPECT_DOUBLE_EQ(ours.controls[0].gain, wanted.controls[0].gain);
  EXPECT_EQ(ours.joints[0].freedoms[0].stiffness, 0.1);
  const auto unknown = WithStiffness(soft.scene, "gripper", 40);
  ASSERT_FALSE(unknown);
  EXPECT_NE(unknown.error().Text().find("there are: a, b, grip"), std::string::npos)
      << unknown.error().Text();
  EXPECT_FALSE(WithStiffness(soft.scene, "grip", 0));
}

}  // namespace
}  // namespace fork1s::testing_importer
