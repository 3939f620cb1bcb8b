// Sensors of plugins that are not there: the rest of the model opens.
#include "importer/mjcf.hpp"

#include "helpers.hpp"

namespace fork1s::testing_importer {
namespace {

const char* const kArm = R"(<worldbody><body name="arm"><joint name="j" axis="0 1 0" stiffness="10"/>
  <geom size=".02"/><site name="pad"/></body></worldbody>)";

const char* const kTouch =
    R"(<extension><plugin plugin="mujoco.sensor.touch_grid"><instance name="i"/></plugin>
  <plugin plugin="mujoco.pid"/></extension>
  <sensor><plugin name="touch" plugin="mujoco.sensor.touch_grid" objtype="site" objname="pad">
    <config key="size" value="7 7"/></plugin><jointpos joint="j"/></sensor>)";

std::string Model(const std::string& content) { return "<mujoco>" + content + "</mujoco>"; }

void ExpectArm(const ImportedScene& loaded) {
  ASSERT_EQ(loaded.scene.mechanisms.size(), 1u);
  EXPECT_EQ(loaded.scene.mechanisms[0].joints[0].freedoms[0].stiffness, 10);
  EXPECT_TRUE(
      HasNote(loaded.report, ImportNote::Kind::kDropped, "sensor 'touch': it is computed by a plugin"));
}

TEST(SensorPlugins, AreLeftOutWithANote) {
  ExpectArm(MustLoad(Model(kArm + std::string(kTouch))));
  const std::string path = WriteFile("arm.xml", Model(kArm + std::string(kTouch)));
  const auto loaded = LoadMechanism(path);
  ASSERT_TRUE(loaded) << loaded.error().Text();
  ExpectArm(*loaded);
  const auto written = ModelAsMjcf(path, {}, ".", "meshes");
  ASSERT_TRUE(written) << written.error().Text();
  ExpectArm(written->imported);
  const ImportedScene two = MustLoad(
      Model(kArm +
            std::string(R"(<sensor><plugin name="a" plugin="x"/><plugin name="b" instance="y"/></sensor>)")));
  EXPECT_TRUE(HasNote(two.report, ImportNote::Kind::kDropped, "2 x sensor: 'a' and 'b' are computed"));
}

// Of two included files of one name, one has the sensor and the other the arm.
TEST(SensorPlugins, OfIncludedFiles_AreLeftOutToo) {
  WriteFile("part.xml", Model(kTouch));
  WriteFile("other/part.xml", Model(kArm));
  const auto loaded = LoadMechanism(
      WriteFile("arm.xml", Model(R"(<include file="other/part.xml"/><include file="part.xml"/>)")));
  ASSERT_TRUE(loaded) << loaded.error().Text();
  ExpectArm(*loaded);
}

TEST(SensorPlugins, OfOtherElements_AreRefusedAtTheirLine) {
  const Error error = MustFail(
      Model(std::string(R"(<extension><plugin plugin="mujoco.foo"/></extension>)") + kArm + kTouch + R"(
    <actuator><plugin joint="j" plugin="mujoco.foo"/></actuator>)"));
  EXPECT_EQ(error.code, ErrorCode::kModel);
  EXPECT_CONTAINS(error.message, "mujoco.foo");
  EXPECT_CONTAINS(error.where, "line 6");
}

}  // namespace
}  // namespace fork1s::testing_importer
