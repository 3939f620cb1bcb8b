// What has no adhesion says so.
#include <fork1s/reference/full_simulation.hpp>

#include "support.hpp"

namespace fork1s::adhesion_test {
namespace {

bool IsDropped(const ImportReport& report, const std::string& part) {
  for (const ImportNote& note : report.notes)
    if (note.kind == ImportNote::Kind::kDropped &&
        (note.where + ": " + note.message).find(part) != std::string::npos)
      return true;
  return false;
}

std::string WithActuator(const std::string& actuator) {
  return "<mujoco><worldbody><body name='post'><geom size='.1'/></body><body name='arm' pos='1 0 0'><joint "
         "name='j'/><geom size='.1'/><body name='rod' pos='.5 0 0'><joint/><geom size='.1' contype='0' "
         "conaffinity='0'/></body></body></worldbody><actuator>" +
         actuator + "</actuator></mujoco>";
}

TEST(Adhesion, ThatHasNoPlaceInTheScene_IsLeftOutWithANote) {
  EXPECT_TRUE(IsDropped(MustLoad(WithActuator("<adhesion name='a' body='post' ctrlrange='0 1'/>")).report,
                        "its body is still"));
  EXPECT_TRUE(IsDropped(MustLoad(WithActuator("<adhesion name='a' body='rod' ctrlrange='0 1'/>")).report,
                        "its body has no shape that can touch"));
  EXPECT_TRUE(IsDropped(
      MustLoad(WithActuator("<general name='a' body='arm' gainprm='2' biastype='affine' biasprm='1'/>"))
          .report,
      "constant gain without bias"));
  const ImportedScene good = MustLoad(WithActuator("<adhesion name='a' body='arm' ctrlrange='0 1'/>"));
  EXPECT_FALSE(IsDropped(good.report, "adhesion"));
  EXPECT_EQ(good.scene.mechanisms.at(0).adhesions.size(), 1u);
}

TEST(Adhesion, OnABodyThatNothingCanTouch_IsRefusedWithARemedy) {
  ImportedScene loaded = MustLoad(WithActuator("<adhesion name='a' body='arm' ctrlrange='0 1'/>"));
  loaded.scene.mechanisms.at(0).adhesions.at(0).body = "rod";
  const auto simulation = Simulation::Create(loaded.scene);
  ASSERT_FALSE(simulation);
  EXPECT_NE(simulation.error().Text().find("give it a shape that collides"), std::string::npos)
      << simulation.error().Text();
}

TEST(Adhesion, InTheFullModel_IsRefused) {
  const Cup cup;
  const auto full = FullSimulation::Create(MustLoad(cup.Text()).scene, {});
  ASSERT_FALSE(full);
  EXPECT_NE(full.error().Text().find("adhesion 'suction'"), std::string::npos) << full.error().Text();
}

TEST(AdhesionOfShapes, InTheFullModel_IsRefused) {
  for (const auto& [text, name] :
       {std::pair{"<geom name='ball' size='.1' adhesion='1'/></body></worldbody>", "geometry 'ball'"},
        {"<geom name='ball' size='.1'/></body></worldbody><contact><pair name='p' geom1='floor' geom2='ball' "
         "adhesion='1'/></contact>",
         "contact pair 'p'"}}) {
    const auto full = FullSimulation::Create(
        MustLoad(
            fmt::format("<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/><body pos='0 0 1'>"
                        "<freejoint/>{}</mujoco>",
                        text))
            .scene,
        {});
    ASSERT_FALSE(full) << name;
    EXPECT_NE(full.error().Text().find(name), std::string::npos) << full.error().Text();
  }
}

}  // namespace
}  // namespace fork1s::adhesion_test
