// Every element and attribute of URDF changes the scene, or has a note, or is listed here as meaningless; and what is
// not of URDF has a note wherever it stands. Names: ROS's description of URDF and urdfdom's schema.
#include <gtest/gtest.h>
#include <fork1s/importer/importer.hpp>

#include <algorithm>
#include <string>
#include <vector>

#include "helpers.hpp"
#include "mesh_writers.hpp"
#include "record/scene_json.hpp"

namespace fork1s::testing_importer {
namespace {

const std::string kSchemaRobot = R"(<robot name="r" version="1.0">
<material name="red"><color rgba="1 0 0 1"/></material>
<link name="base"><inertial><mass value="5"/><inertia ixx="1" iyy="1.1" izz="1.2" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="upper">
  <inertial><origin xyz=".1 0 0" rpy=".3 -.2 .5"/><mass value="2"/>
    <inertia ixx=".03" ixy=".001" ixz=".002" iyy=".04" iyz="-.003" izz=".05"/></inertial>
  <visual name="seen"><origin xyz="0 .2 0" rpy=".1 0 0"/><geometry><box size=".1 .2 .3"/></geometry><material name="red"/></visual>
  <visual><geometry><cylinder radius=".04" length=".5"/></geometry><material name="own"><color rgba="0 1 0 .5"/></material></visual>
  <collision name="felt"><origin xyz="0 0 .3" rpy="0 .1 0"/><geometry><cylinder radius=".05" length=".4"/></geometry></collision>
  <collision><geometry><box size=".11 .12 .13"/></geometry></collision>
  <collision><geometry><sphere radius=".07"/></geometry></collision>
  <collision><geometry><capsule radius=".02" length=".15"/></geometry></collision>
  <collision><geometry><mesh filename="tetra.stl" scale="1 2 3"/></geometry></collision>
</link>
<link name="lower"><inertial><mass value="1"/><inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="end"><inertial><mass value="1.5"/><inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute">
  <origin xyz="0 0 1" rpy="0 0 .4"/><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="2"/><dynamics damping=".5" friction=".2"/>
  <calibration rising="0" falling="1" reference_position="0"/></joint>
<joint name="elbow" type="continuous"><origin xyz="0 0 .4"/><parent link="upper"/><child link="lower"/><axis xyz="1 0 0"/>
  <mimic joint="shoulder" multiplier="2" offset=".1"/></joint>
<joint name="slide" type="prismatic"><origin xyz="0 0 .6"/><parent link="upper"/><child link="end"/><axis xyz="0 0 1"/>
  <limit lower="0" upper=".1" effort="50" velocity="1"/></joint>
<gazebo reference="shoulder"><springStiffness>3</springStiffness><springReference>.2</springReference></gazebo>
</robot>)";

// Two four-bars, closed by what is not of ROS's URDF.
std::string LoopRobot() {
  const std::string inertial =
      R"(<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>)";
  std::string text = R"(<robot name="loops"><link name="base"/>)";
  for (const std::string side : {"1", "2"}) {
    for (const char* link : {"a", "b", "c"})
      text += "<link name=\"" + (link + side) + "\">" + inertial + "</link>";
    const auto hinge = [&](const std::string& parent, const std::string& child, const std::string& at) {
      text += "<joint name=\"j" + child + "\" type=\"continuous\"><origin xyz=\"" + at +
              "\"/><parent link=\"" + parent + "\"/><child link=\"" + child +
              "\"/><axis xyz=\"0 0 1\"/></joint>";
    };
    hinge("base", "a" + side, "0 0 0");
    hinge("base", "b" + side, "1 0 0");
    hinge("a" + side, "c" + side, "0 1 0");
  }
  return text + R"(
<loop_joint name="loop" type="continuous"><link1 link="c1" xyz="1 0 0" rpy="0 0 .1"/><link2 link="b1" xyz="0 1 .0" rpy="0 0 .2"/>
  <axis xyz="0 0 1.0"/></loop_joint>
<drake:ball_constraint><drake:ball_constraint_body_A name="c2"/><drake:ball_constraint_body_B name="b2"/>
  <drake:ball_constraint_p_AP value="1 0 0"/><drake:ball_constraint_p_BQ value="0 1 0"/></drake:ball_constraint>
</robot>)";
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  EXPECT_EQ(text.find(from, at + 1), std::string::npos) << from << " stands there twice";
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

// What is understood of it: the scene to the last bit, and the notes.
std::string UnderstoodUrdf(const std::string& text) {
  WriteFile("tetra.stl", BinaryStl(CornerTetrahedron(.1, .2, .3)));
  ImportOptions options;
  options.pd = PdGains{100, 10};  // by which bounds of effort and velocity act
  const auto loaded = LoadMechanism(WriteFile("schema.urdf", text), options);
  if (!loaded) return "refused: " + loaded.error().Text();
  std::string out = WriteScene(loaded->scene).json;
  for (const ImportNote& note : loaded->report.notes) out += "\n" + note.Text();
  for (const auto& [joint, limit] : loaded->report.velocity_limits)
    out += "\n" + joint + std::to_string(limit);
  return out;
}

TEST(UrdfSchema, EveryAttribute_ChangesTheSceneOrHasANote) {
  const std::string before = UnderstoodUrdf(kSchemaRobot);
  ASSERT_FALSE(before.starts_with("refused")) << before;
  const std::vector<std::pair<std::string, std::string>> changes = {
      {"name=\"r\"", "name=\"s\""},
      {"\"1 0 0 1\"", "\"1 1 0 1\""},
      {"link name=\"end\"", "link name=\"END\""},
      {"xyz=\".1 0 0\"", "xyz=\".2 0 0\""},
      {"rpy=\".3 -.2 .5\"", "rpy=\".3 -.2 .6\""},
      {"mass value=\"2\"", "mass value=\"2.5\""},
      {"ixx=\".03\"", "ixx=\".031\""},
      {"ixy=\".001\"", "ixy=\".0011\""},
      {"ixz=\".002\"", "ixz=\".0021\""},
      {"iyy=\".04\"", "iyy=\".041\""},
      {"iyz=\"-.003\"", "iyz=\"-.0031\""},
      {"izz=\".05\"", "izz=\".051\""},
      {"xyz=\"0 .2 0\"", "xyz=\"0 .3 0\""},
      {"rpy=\".1 0 0\"", "rpy=\".2 0 0\""},
      {"size=\".1 .2 .3\"", "size=\".1 .2 .4\""},
      {"<material name=\"red\"/>", "<material name=\"blue\"/>"},
      {"radius=\".04\"", "radius=\".041\""},
      {"length=\".5\"", "length=\".6\""},
      {"\"0 1 0 .5\"", "\"0 1 0 .6\""},
      {"xyz=\"0 0 .3\"", "xyz=\"0 0 .31\""},
      {"rpy=\"0 .1 0\"", "rpy=\"0 .2 0\""},
      {"radius=\".05\"", "radius=\".051\""},
      {"length=\".4\"", "length=\".41\""},
      {"size=\".11 .12 .13\"", "size=\".11 .12 .14\""},
      {"radius=\".07\"", "radius=\".08\""},
      {"radius=\".02\"", "radius=\".03\""},
      {"length=\".15\"", "length=\".16\""},
      {"tetra.stl", "none.stl"},
      {"scale=\"1 2 3\"", "scale=\"1 2 4\""},
      {"joint name=\"slide\"", "joint name=\"SLIDE\""},
      {"type=\"prismatic\"", "type=\"continuous\""},
      {"xyz=\"0 0 1\" rpy", "xyz=\"0 0 1.1\" rpy"},
      {"rpy=\"0 0 .4\"", "rpy=\"0 0 .5\""},
      {"<parent link=\"base\"/>", "<parent link=\"BASE\"/>"},
      {"<child link=\"lower\"/>", "<child link=\"LOWER\"/>"},
      {"<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 1 1\"/>"},
      {"lower=\"-1\"", "lower=\"-1.1\""},
      {"upper=\"2\"", "upper=\"2.1\""},
      {"effort=\"50\"", "effort=\"51\""},
      {"velocity=\"1\"", "velocity=\"2\""},
      {"damping=\".5\"", "damping=\".6\""},
      {"friction=\".2\"", "friction=\".3\""},
      {"mimic joint=\"shoulder\"", "mimic joint=\"slide\""},
      {"multiplier=\"2\"", "multiplier=\"3\""},
      {"offset=\".1\"", "offset=\".2\""},
      {">3</springStiffness>", ">4</springStiffness>"},
      {">.2</springReference>", ">.3</springReference>"},
      // Elements of URDF that nothing here acts on.
      {"<color rgba=\"1 0 0 1\"/>", "<color rgba=\"1 0 0 1\"/><texture filename=\"wood.png\"/>"},
      {"<dynamics", "<safety_controller soft_lower_limit=\"-.9\" k_velocity=\"10\"/><dynamics"},
      {"<gazebo", "<transmission name=\"t\"><joint name=\"shoulder\"/></transmission><gazebo"},
  };
  for (const auto& [from, to] : changes)
    EXPECT_NE(UnderstoodUrdf(Replaced(kSchemaRobot, from, to)), before) << from << " became " << to;
  // The version of the language, names that nobody looks up, and where encoders have their zero.
  for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
           {"version=\"1.0\"", "version=\"1.1\""},
           {"name=\"seen\"", "name=\"drawn\""},
           {"name=\"felt\"", "name=\"touched\""},
           {"name=\"own\"", "name=\"mine\""},
           {"rising=\"0\"", "rising=\"1\""},
           {"falling=\"1\"", "falling=\"0\""},
           {"reference_position=\"0\"", "reference_position=\"1\""}})
    EXPECT_EQ(UnderstoodUrdf(Replaced(kSchemaRobot, from, to)), before) << from << " became " << to;
}

TEST(UrdfSchema, EveryAttributeOfLoops_ChangesTheSceneOrHasANote) {
  const std::string robot = LoopRobot(), before = UnderstoodUrdf(robot);
  ASSERT_FALSE(before.starts_with("refused")) << before;
  for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
           {"loop_joint name=\"loop\"", "loop_joint name=\"pin\""},
           {"loop\" type=\"continuous\"", "loop\" type=\"prismatic\""},
           {"link1 link=\"c1\"", "link1 link=\"c2\""},
           {"xyz=\"1 0 0\" rpy", "xyz=\"1.01 0 0\" rpy"},
           {"rpy=\"0 0 .1\"", "rpy=\"0 .1 .1\""},
           {"link2 link=\"b1\"", "link2 link=\"b2\""},
           {"xyz=\"0 1 .0\"", "xyz=\"0 1.01 .0\""},
           {"rpy=\"0 0 .2\"", "rpy=\"0 .1 .2\""},
           {"xyz=\"0 0 1.0\"", "xyz=\"0 1 1.0\""},
           {"body_A name=\"c2\"", "body_A name=\"a2\""},
           {"body_B name=\"b2\"", "body_B name=\"b1\""},
           {"p_AP value=\"1 0 0\"", "p_AP value=\"1.01 0 0\""},
           {"p_BQ value=\"0 1 0\"", "p_BQ value=\"0 1.01 0\""}})
    EXPECT_NE(UnderstoodUrdf(Replaced(robot, from, to)), before) << from << " became " << to;
}

// In each element an attribute and an element that URDF does not have, and a second one of what there may be one of.
TEST(UrdfSchema, WhatIsNotOfUrdf_HasANoteWhereverItStands) {
  static const std::vector<std::string> several = {"robot",     "link",  "visual",
                                                   "collision", "joint", "material"};
  std::size_t tried = 0;
  for (const std::string& robot : {kSchemaRobot, LoopRobot()}) {
    const std::string before = UnderstoodUrdf(robot);
    for (std::size_t begin = robot.find('<'); begin != std::string::npos;
         begin = robot.find('<', begin + 1)) {
      if (robot[begin + 1] == '/') continue;
      const std::size_t end = robot.find('>', begin), name_end = robot.find_first_of(" />", begin);
      const std::string name = robot.substr(begin + 1, name_end - begin - 1);
      if (name == "calibration" || name.starts_with("spring"))
        continue;  // meaningless as a whole; text alone
      const bool closes_itself = robot[end - 1] == '/';
      std::string attribute = robot, child = robot;
      attribute.insert(name_end, " unheard=\"1\"");
      if (closes_itself)
        child.replace(end - 1, 2, "><unheard/></" + name + ">");
      else
        child.insert(end + 1, "<unheard/>");
      EXPECT_NE(UnderstoodUrdf(attribute).find("unheard"), std::string::npos) << name;
      EXPECT_NE(UnderstoodUrdf(child).find("unheard"), std::string::npos) << name;
      tried += 2;
      if (!closes_itself || std::count(several.begin(), several.end(), name) > 0) continue;
      std::string twice = robot;
      twice.insert(begin, robot.substr(begin, end + 1 - begin));
      EXPECT_NE(UnderstoodUrdf(twice), before) << "two <" << name << ">";
      ++tried;
    }
  }
  EXPECT_GT(tried, 200u);
}

}  // namespace
}  // namespace fork1s::testing_importer
