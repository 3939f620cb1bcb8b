// What the choice of interface bodies gains: said by inspect and reduce, and never as if it gained nothing.
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

// Two bent fingers of three hinges each on a palm: each tip moves in three ways, all that its hinges allow.
std::string Hand(const std::string& interfaces, const std::string& stiffness = "1") {
  std::string fingers;
  for (const char* name : {"left", "right"}) {
    const std::string side = name[0] == 'l' ? "-.03" : ".03", n = name;
    const std::string shape = "<geom type='capsule' fromto='0 0 0 0 0 .03' size='.005' mass='.02'/>";
    const std::string spring = "' axis='0 1 0' stiffness='" + stiffness + "' damping='.01'/>";
    fingers += "<body name='" + n + "_a' pos='" + side + " 0 0'><joint name='" + n + "_1" + spring + shape +
               "<body name='" + n + "_b' pos='.01 0 .03'><joint name='" + n + "_2" + spring + shape +
               "<body name='" + n + "_tip' pos='0 0 .03'><joint name='" + n + "_3" + spring + shape +
               "</body></body></body>";
  }
  return Write("gain.xml",
               "<mujoco><custom><text name='fork1s_interface' data='" + interfaces +
                   "'/><numeric name='fork1s_modes' data='0'/></custom><worldbody><body name='palm'>"
                   "<geom type='box' size='.04 .01 .01' mass='.1'/>" +
                   fingers + "</body></worldbody></mujoco>");
}

TEST(Gain, NamesWhatTouchesAndWhatFewerWouldLeave) {
  for (const char* command : {"inspect ", "reduce "}) {
    const Outcome o = Fork1s(command + Hand("left_tip right_tip"));
    ASSERT_EQ(o.code, 0) << o.err;
    EXPECT_EQ(o.out.find("saves nothing"), std::string::npos) << o.out;
    EXPECT_NE(o.out.find("Reduction: all 6 independent joint coordinates"), std::string::npos) << o.out;
    EXPECT_NE(o.out.find("contact at 2 of 7 bodies with shapes"), std::string::npos) << o.out;
    EXPECT_NE(o.out.find("4 bodies with colliding shapes are no interface and touch nothing: 'left_a', "),
              std::string::npos)
        << o.out;
    // One tip leaves five: what weight bends of the other finger is simulated too.
    EXPECT_NE(o.out.find("fewer interface bodies leave nearly as many coordinates"), std::string::npos)
        << o.out;
    EXPECT_NE(o.out.find("if every body might touch"), std::string::npos) << o.out;
  }
  // The advice holds: followed, it leaves what was said.
  const auto all = Fork1s("reduce --json " + Hand("left_tip right_tip")).Json();
  ASSERT_EQ(all["gain"]["fewer"].size(), 1u) << all["gain"].dump(1);
  EXPECT_EQ(all["gain"]["fewer"][0]["coordinates"], 5);
  const auto& fewer = all["gain"]["fewer"][0];
  const auto one = Fork1s("reduce --json --interface " + fewer["interfaces"][0].get<std::string>() + " " +
                          Hand("left_tip right_tip"))
                       .Json();
  EXPECT_EQ(one["gain"]["coordinates"]["reduced"], fewer["coordinates"]);
  EXPECT_EQ(one["gain"]["coordinates"]["full"], 6);
  EXPECT_TRUE(all["step_us"]["interface"].is_number());
}

TEST(Gain, StiffSpringsAskAnExplicitStepForMore) {
  // Told only where the step taken here is longer than an explicit one may be.
  EXPECT_EQ(Fork1s("reduce " + Hand("left_tip", "1e-4")).out.find("explicit steps"), std::string::npos);
  const auto json = Fork1s("reduce --json " + Hand("left_tip", "100")).Json();
  EXPECT_NE(json["gain"]["text"].dump().find("explicit steps"), std::string::npos) << json["gain"].dump(1);
  EXPECT_NEAR(json["gain"]["explicit_step_s"].get<double>() * json["gain"]["fastest_hz"].get<double>(),
              1 / 3.14159265358979, 1e-9);
}

TEST(Gain, BodiesThatCannotBeLeftOutAreNamed) {
  const auto json = Fork1s("reduce --json " + Hand("left_tip right_tip", "0")).Json();
  EXPECT_EQ(json["gain"]["must_stay"].size(), 2u) << json["gain"].dump(1);
  EXPECT_NE(json["gain"]["text"].dump().find("cannot be left out"), std::string::npos)
      << json["gain"].dump(1);
}

// A four-bar linkage with one spring: the other two joints are passive, and its one coordinate is counted
// once.
TEST(Inspect, LoopJointsAreClosedByTheirClosure) {
  const std::string model = Write("fourbar.xml", R"(<mujoco><worldbody>
    <body name="crank"><joint name="a" axis="0 1 0" stiffness="1"/><geom type="capsule" fromto="0 0 0 0 0 .1" size=".01"/>
      <body name="coupler" pos="0 0 .1"><joint name="b" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 .2 0 0" size=".01"/></body></body>
    <body name="rocker" pos=".2 0 0"><joint name="c" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 .1" size=".01"/></body>
    </worldbody><equality><connect name="pin" body1="coupler" body2="rocker" anchor=".2 0 0"/></equality>
    <contact><exclude body1="coupler" body2="rocker"/></contact></mujoco>)");
  const Outcome o = Fork1s("inspect " + model);
  ASSERT_EQ(o.code, 0) << o.err;
  EXPECT_EQ(o.out.find("Motions without stiffness"), std::string::npos) << o.out;
  EXPECT_NE(o.out.find("b  closed by 'pin'"), std::string::npos) << o.out;
  EXPECT_NE(o.out.find("c  closed by 'pin'"), std::string::npos) << o.out;
  EXPECT_NE(o.out.find("3 joints, 1 closures"), std::string::npos) << o.out;
  EXPECT_NE(o.out.find("the one independent joint coordinate"), std::string::npos) << o.out;
}

// A rope from the world makes a mechanism of a free body, whose six motions nothing resists.
TEST(Inspect, ALooseBodyHasOneSentence) {
  const auto loose = Fork1s("inspect --json " + Write("loose.xml", R"(<mujoco><worldbody>
    <site name="w" pos="0 0 1"/><body name="load" pos="0 0 .2"><freejoint name="lf"/><geom size=".1"/><site name="s"/>
    </body></worldbody><tendon><spatial name="rope" limited="true" range="0 1.5"><site site="w"/><site site="s"/>
    </spatial></tendon></mujoco>)"))
                         .Json()["not_held"];
  ASSERT_EQ(loose.size(), 1u) << loose.dump(1);
  const auto sentence = loose[0].get<std::string>();
  for (const char* part : {"'load' is loose", "'lf'", "lf.position=KP,KV and lf.rotation=KP,KV"})
    EXPECT_NE(sentence.find(part), std::string::npos) << sentence;
}

TEST(Inspect, StiffnessOfATendonHasTheUnitOfItsJoints) {
  const auto over = [](const std::string& type) {
    return Fork1s("inspect --json " +
                  Write("tendon_" + type + ".xml",
                        "<mujoco><worldbody><body><joint name='a' axis='0 1 0' type='" + type +
                            "'/><geom size='.1'/><body pos='.4 0 0'><joint name='b' "
                            "axis='1 0 0' type='" +
                            type +
                            "'/><geom size='.1'/></body></body></worldbody><tendon><fixed "
                            "name='t'><joint joint='a' coef='1'/><joint joint='b' coef='1'/>"
                            "</fixed></tendon><actuator><position name='p' tendon='t' "
                            "kp='100'/></actuator></mujoco>"))
        .Json()["holds"][0]["held_by"]
        .get<std::string>();
  };
  EXPECT_EQ(over("hinge"), "actuator 'p' over 2 freedoms, 100 N·m/rad");
  EXPECT_EQ(over("slide"), "actuator 'p' over 2 freedoms, 100 N/m");
}

TEST(Interfaces, BlanksAndCommasBothDivideNames) {
  const auto names = [](const std::string& data) {
    return Fork1s("inspect --json " + Hand(data)).Json()["mechanisms"][0]["interfaces"];
  };
  EXPECT_EQ(names("left_tip, right_tip"), names("left_tip right_tip"));
  EXPECT_EQ(names("left_tip,right_tip"), names("left_tip right_tip"));
}

TEST(Gain, ARunDoesNotWarnOfIt) {
  const Outcome o = Fork1s("run --json --time 0.1 " + Hand("left_tip right_tip"));
  ASSERT_EQ(o.code, 0) << o.err;
  EXPECT_TRUE(o.Json()["warnings"].empty()) << o.Json()["warnings"].dump(1);
}

}  // namespace
}  // namespace fork1s::test
