// What steps of this length cannot follow is said, with time and body; what a machine does is not.
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

std::string Thrown(const std::string& velocity) {
  return Write(
      "thrown.xml",
      "<mujoco><worldbody><geom name='floor' type='plane' size='9 9 .1'/><body name='box' pos='0 0 1'>"
      "<freejoint/><geom type='box' size='.1 .05 .02' mass='1'/></body></worldbody>"
      "<keyframe><key name='k' qpos='0 0 1 1 0 0 0' qvel='" +
          velocity + "'/></keyframe></mujoco>");
}

std::string WarningsOf(const std::string& arguments, int code = 0, const std::string& time = "1") {
  const Outcome o = Fork1s("run --json --time " + time + " " + arguments);
  EXPECT_EQ(o.code, code) << o.err;
  return o.code == code && !o.out.empty() ? o.Json()["warnings"].dump() : "";
}

TEST(Plausible, WhatAMachineDoesIsNotRemarkedUpon) {
  EXPECT_EQ(WarningsOf("--keyframe k " + Thrown("1 0 -3 2 1 0")), "[]");
  EXPECT_EQ(WarningsOf(Write("finger.xml", FingerModel())), "[]");
}

// Boxes on each other, turned about the vertical: contacts give way by micrometres and come back.
TEST(Plausible, AStackAtRestIsNotRemarkedUpon) {
  const auto stack = [](const std::vector<std::pair<double, double>>& boxes) {
    std::string bodies;
    for (std::size_t i = 0; i < boxes.size(); ++i)
      bodies += "<body pos='0 0 " + std::to_string(0.05 + 0.1 * static_cast<double>(i)) + "' euler='0 0 " +
                std::to_string(boxes[i].first) + "'><freejoint/><geom type='box' size='.05 .05 .05' mass='" +
                std::to_string(boxes[i].second) + "'/></body>";
    return Write("stack.xml",
                 "<mujoco><worldbody><geom type='plane' size='2 2 .1'/>" + bodies + "</worldbody></mujoco>");
  };
  for (const auto& boxes :
       {std::vector<std::pair<double, double>>{{5, 2}, {2, 1}, {31, 0.5}, {33, 2}, {13, 1}},
        {{0, 1}, {6, 1}, {11, 1}, {17, 1}, {23, 1}},
        {{38, 1}, {3, 2}, {20, 2}, {35, 0.5}, {12, 1}, {28, 2}}})
    EXPECT_EQ(WarningsOf(stack(boxes), 0, "30"), "[]");
}

// At 1e5 m/s the floor stops it half way through.
TEST(Plausible, TooFastForTheStep) {
  const std::string said = WarningsOf("--keyframe k " + Thrown("0 0 -1e5 0 0 0"));
  EXPECT_NE(said.find("deep in the world"), std::string::npos) << said;
}

// A driven base goes on where its controls say.
TEST(Plausible, ADrivenBaseIsToldOfItsControls) {
  const std::string model = Write("driven.xml", R"(<mujoco><worldbody><geom type="plane" size="9 9 .1"/>
    <body name="palm" pos="0 0 .2"><geom type="box" size=".1 .1 .05"/><body name="tip" pos="0 0 .2">
    <joint name="j" axis="0 1 0" stiffness="9"/><geom size=".02"/></body></body></worldbody></mujoco>)");
  const std::string table = Write("down.csv", "time,palm.z\n0,0\n1,-.2\n");
  const std::string said = WarningsOf("--base driven --controls " + table + " " + model, 0, "2");
  EXPECT_NE(said.find("its controls drive 'palm', which no contact stops"), std::string::npos) << said;
  EXPECT_EQ(said.find("bring their masses"), std::string::npos) << said;
}

// Its finger stands on the floor and cannot bend aside.
TEST(Plausible, AFingerOfADrivenBaseIsToldOfItsControls) {
  const std::string model = Write("pressed.xml", R"(<mujoco><worldbody><geom type="plane" size="1 1 .1"/>
    <body name="palm" pos="0 0 .2"><geom type="box" size=".05 .05 .01" mass=".2"/><body name="f" pos="0 0 -.01">
    <joint name="f" axis="0 1 0" stiffness="2" damping=".02"/>
    <geom type="capsule" fromto="0 0 0 0 0 -.1" size=".01" mass=".05"/></body></body></worldbody></mujoco>)");
  const std::string table = Write("press.csv", "time,palm.z\n0,0\n.5,-.12\n1,-.12\n");
  const std::string said = WarningsOf("--base driven --controls " + table + " " + model, 0, "1");
  EXPECT_NE(said.find("are wedged"), std::string::npos) << said;
  EXPECT_NE(said.find("its controls drive 'palm', which no contact stops"), std::string::npos) << said;
  for (const char* other : {"smaller time step", "bring their masses", "apart at the start"})
    EXPECT_EQ(said.find(other), std::string::npos) << said;
}

// 5 rad a step are stepped, with a warning that has body, angle and remedy.
TEST(Plausible, TurnsByMoreThanHalfATurnInAStep) {
  const std::string said = WarningsOf("--keyframe k " + Thrown("0 0 0 30 300 1"), 0, "0.2");
  EXPECT_NE(said.find("'box' turns by 5.0"), std::string::npos) << said;
  EXPECT_NE(said.find("try a time step of 0.003 s"), std::string::npos) << said;
}

// At 1e4 rad/s no step is solved.
TEST(Plausible, SpinsTooFastForTheStep) {
  const std::string thrown = "--keyframe k " + Thrown("0 0 0 3e3 1e4 100");
  const Outcome o = Fork1s("run --time 1 " + thrown);
  EXPECT_EQ(o.code, 4);
  EXPECT_NE(o.err.find("'box' could not be solved"), std::string::npos) << o.err;
}

// Faster than numbers go: exit 4, a sentence without a body of no name, and no step of 0 s as a remedy.
TEST(Plausible, SpinsBeyondNumbers) {
  const Outcome o = Fork1s("run --time 1 --keyframe k " + Thrown("0 0 0 0 1e200 0"));
  EXPECT_EQ(o.code, 4) << o.err;
  EXPECT_EQ((o.out + o.err).find("''"), std::string::npos) << o.err;
  EXPECT_EQ((o.out + o.err).find("a time step of 0"), std::string::npos) << o.out;
}

// The contact of a light body gives way under a heavy one.
TEST(Plausible, SinksIntoWhatItRestsOn) {
  const auto stack = [](const std::string& mass) {
    return Write(
        "stack.xml",
        "<mujoco><worldbody><geom type='plane' size='1 1 .1'/><body name='light' pos='0 0 .1'><freejoint/>"
        "<geom type='box' size='.1 .1 .1' mass='1'/></body><body name='heavy' pos='0 0 .3'><freejoint/>"
        "<geom type='box' size='.1 .1 .1' mass='" +
            mass + "'/></body></worldbody></mujoco>");
  };
  const std::string said = WarningsOf("--integrator euler " + stack("1e10"));
  EXPECT_NE(said.find("mm into "), std::string::npos) << said;
  EXPECT_EQ(WarningsOf(stack("10")), "[]");
}

// A set-point that jumps by 1000 rad: the joint opened to 1e145 m, and the program said that all was well.
TEST(Plausible, SetPointsThatJump) {
  std::string text = FingerModel();
  const std::string range = " ctrllimited=\"true\" ctrlrange=\"-1 1\"";
  text.erase(text.find(range), range.size());
  const std::string model = Write("free_finger.xml", text),
                    jump = Write("jump.csv", "time,bend\n0,0\n0.5,1000\n");
  const std::string file = (ScratchFolder() / "jump.h5").string(),
                    folder = (ScratchFolder() / "jump").string();
  const Outcome o = Fork1s("run --json --time 1 --record " + file + " --controls " + jump + " " + model);
  EXPECT_TRUE(o.code == 4 || o.Json()["warnings"].dump() != "[]") << o.out;
  ASSERT_EQ(Fork1s("export " + file + " " + folder).code, 0);
  for (const auto& table : std::filesystem::directory_iterator(folder))
    for (const char* none : {",inf", ",-inf", ",nan", ",-nan"})
      EXPECT_EQ(Slurp(table.path()).find(none), std::string::npos) << table.path() << none;
}

// What a mechanism of light bodies ends with when it is thrown about: exit 4, and tables of what was before.
TEST(Plausible, TablesOfWhatBlewUpAreFinite) {
  const std::string file = (ScratchFolder() / "blown.h5").string(),
                    folder = (ScratchFolder() / "blown").string();
  WarningsOf("--record " + file + " --keyframe k " + Thrown("4e8 0 0 0 0 0"), 4);
  ASSERT_EQ(Fork1s("export " + file + " " + folder).code, 0);
  for (const auto& table : std::filesystem::directory_iterator(folder))
    for (const char* none : {",inf", ",-inf", ",nan", ",-nan"})
      EXPECT_EQ(Slurp(table.path()).find(none), std::string::npos) << table.path() << none;
}

}  // namespace
}  // namespace fork1s::test
