// Files that cannot be used: each says file, element, cause and remedy.
#include "helpers.hpp"

namespace fork1s::testing_importer {
namespace {

std::string Body(const std::string& joint, const std::string& more = R"(<geom size=".1"/>)",
                 const std::string& after = "") {
  return "<mujoco>\n<worldbody>\n<body name=\"arm\">\n<joint name=\"elbow\" " + joint + "/>\n" + more +
         "\n</body></worldbody>\n" + after + "</mujoco>";
}

struct Bad {
  const char* name;
  std::string text;
  ErrorCode code;
  std::vector<std::string> says;
};
void PrintTo(const Bad& bad, std::ostream* os) { *os << bad.name; }

class BadFile : public ::testing::TestWithParam<Bad> {};

TEST_P(BadFile, IsRefusedWithASentence) {
  const Error error = MustFail(GetParam().text);
  EXPECT_EQ(static_cast<int>(error.code), static_cast<int>(GetParam().code)) << error.Text();
  EXPECT_CONTAINS(error.where, "test.xml");
  for (const std::string& part : GetParam().says) EXPECT_CONTAINS(error.Text(), part);
}

INSTANTIATE_TEST_SUITE_P(
    Importer, BadFile,
    ::testing::Values(
        Bad{"sdformat",
            R"(<?xml version="1.0"?><sdf version="1.9"><model name="m"/></sdf>)",
            ErrorCode::kFormat,
            {"is a file of Gazebo (SDFormat)", "sdf2mjcf test.xml test_mjcf.xml", "sdformat-mjcf", "URDF"}},
        Bad{"sdformat_of_its_first_versions",
            "<gazebo version='1.0'><world/></gazebo>",
            ErrorCode::kFormat,
            {"SDFormat"}},
        Bad{"another_root", "<scene/>", ErrorCode::kFormat, {"the root element is <scene>"}},
        Bad{"a_comment_alone", "<!-- nothing -->\n", ErrorCode::kFormat, {"the file holds no XML element"}},
        Bad{"nan_mass",
            Body("", R"(<geom size=".1" mass="nan"/>)"),
            ErrorCode::kModel,
            {"line 5", "mass=\"nan\"", "write a number"}},
        Bad{"inf_stiffness",
            Body(R"(stiffness="-Inf")"),
            ErrorCode::kModel,
            {"line 4", "'elbow'", "stiffness"}},
        Bad{"overflow", Body(R"(stiffness="1e999")"), ErrorCode::kFormat, {"stiffness"}},
        Bad{"negative_stiffness",
            Body(R"(stiffness="-3")"),
            ErrorCode::kModel,
            {"'elbow'", "-3", "0 or more"}},
        Bad{"negative_damping", Body(R"(damping="-3")"), ErrorCode::kModel, {"'elbow'", "damping"}},
        Bad{"negative_mass",
            Body("", R"(<geom name="lump" size=".1" mass="-1"/>)"),
            ErrorCode::kModel,
            {"'lump'", "negative", "positive"}},
        Bad{"no_mass", Body("", ""), ErrorCode::kModel, {"'arm'", "<inertial>"}},
        Bad{"zero_inertia",
            Body("", R"(<inertial pos="0 0 0" mass="1" diaginertia="0 0 0"/>)"),
            ErrorCode::kModel,
            {"'arm'"}},
        Bad{"zero_axis", Body(R"(axis="0 0 0")"), ErrorCode::kModel, {"'elbow'", "non-zero axis"}},
        Bad{"newer_attribute",
            Body("", R"(<geom size=".1"/><body wobble="1"/>)"),
            ErrorCode::kFormat,
            {"line 5", "wobble", "this reader, MuJoCo"}},
        Bad{"newer_keyword",
            "<mujoco>\n<option integrator=\"leapfrog\"/></mujoco>",
            ErrorCode::kFormat,
            {"line 2", "leapfrog", "this reader, MuJoCo"}},
        Bad{"truncated", "<mujoco>\n<worldbody>\n<body", ErrorCode::kFormat, {"line 3", "well-formed"}},
        Bad{"empty", "", ErrorCode::kFormat, {"empty"}},
        Bad{"comment_only", "<!-- nothing -->", ErrorCode::kFormat, {}},
        Bad{"other_xml", "<html><body/></html>", ErrorCode::kFormat, {"<html>", "<mujoco>"}},
        Bad{"missing_mesh",
            Body("", R"(<geom type="mesh" mesh="m"/>)", R"(<asset><mesh name="m" file="gone.stl"/></asset>)"),
            ErrorCode::kModel,
            {"line 7", "gone.stl", "put the file there"}},
        Bad{"nothing_moves",
            "<mujoco><worldbody><body><geom size='.1'/></body></worldbody></mujoco>",
            ErrorCode::kModel,
            {"nothing in the file can move"}},
        Bad{"bad_keyframe",
            Body("", R"(<geom size=".1"/>)", R"(<keyframe><key qpos="inf"/></keyframe>)"),
            ErrorCode::kModel,
            {"qpos"}},
        Bad{"unknown_interface",
            Body("", R"(<geom size=".1"/>)",
                 R"(<custom><text name="fork1s_interface" data="amr"/></custom>)"),
            ErrorCode::kModel,
            {"fork1s_interface", "'amr'", "'arm'"}},
        Bad{"empty_interface",
            Body("", R"(<geom size=".1"/>)", R"(<custom><text name="fork1s_interface" data=" "/></custom>)"),
            ErrorCode::kModel,
            {"fork1s_interface", "names no body"}},
        Bad{"unknown_base",
            Body("", R"(<geom size=".1"/>)", R"(<custom><text name="fork1s_base" data="flying"/></custom>)"),
            ErrorCode::kModel,
            {"fork1s_base", "flying", "floating"}},
        Bad{"bad_modes",
            Body("", R"(<geom size=".1"/>)", R"(<custom><numeric name="fork1s_modes" data="-2"/></custom>)"),
            ErrorCode::kModel,
            {"fork1s_modes", "-2"}},
        Bad{"bad_mode_choice",
            Body("", R"(<geom size=".1"/>)",
                 R"(<custom><text name="fork1s_mode_choice" data="best"/></custom>)"),
            ErrorCode::kModel,
            {"fork1s_mode_choice", "'best'", "contribution"}}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(ImportErrors, FilesThatCannotBeRead) {
  auto loaded = LoadMechanism("/no/such/file.xml");
  ASSERT_FALSE(loaded);
  EXPECT_EQ(loaded.error().code, ErrorCode::kFile);
  loaded = LoadMechanism(::testing::TempDir());
  ASSERT_FALSE(loaded);
  EXPECT_CONTAINS(loaded.error().message, "folder");
}

TEST(ImportErrors, FilesOfGazeboAreNamedByTheirExtension) {
  for (const char* name : {"robot.sdf", "yard.world"}) {
    const auto other = LoadMechanism(WriteFile(name, "<world/>"));
    ASSERT_FALSE(other);
    EXPECT_EQ(other.error().code, ErrorCode::kFormat);
    EXPECT_CONTAINS(other.error().where, name);
    EXPECT_CONTAINS(other.error().message, "SDFormat");
  }
  EXPECT_TRUE(LoadMechanism(WriteFile("model.world", Body(""))));
}

TEST(ImportErrors, DeepNesting) {
  const auto chain = [](int n) {
    std::string text = "<mujoco><worldbody>";
    for (int i = 0; i < n; ++i) text += R"(<body pos="0 0 1"><joint stiffness="1"/><geom size=".1"/>)";
    for (int i = 0; i < n; ++i) text += "</body>";
    return text + "</worldbody></mujoco>";
  };
  const Error error = MustFail(chain(200));
  EXPECT_EQ(error.code, ErrorCode::kFormat);
  EXPECT_CONTAINS(error.message, "nested too deeply");
  EXPECT_EQ(MustLoad(chain(90)).scene.mechanisms[0].bodies.size(), 91u);
}

TEST(ImportErrors, IncludedFileIsNamedWithItsLine) {
  WriteFile("part.xml", "<mujoco>\n<default>\n<joint\n wobble='1'/></default></mujoco>");
  const std::string path = WriteFile("main.xml", "<mujoco><include file='part.xml'/></mujoco>");
  const auto loaded = LoadMechanism(path);
  ASSERT_FALSE(loaded);
  EXPECT_CONTAINS(loaded.error().where, "part.xml, line 4");
  WriteFile("part.xml", "<mujoco>\n<option timestep='nan'/></mujoco>");
  const auto second = LoadMechanism(path);
  ASSERT_FALSE(second);
  EXPECT_CONTAINS(second.error().where, "part.xml, line 2");
}

TEST(ImportErrors, BodyNamedInfIsNoNumber) {
  EXPECT_EQ(
      MustLoad("<mujoco><worldbody><body name='inf'><joint name='nan'/><geom size='.1'/></body></worldbody>"
               "</mujoco>")
          .scene.mechanisms[0]
          .bodies[1]
          .name,
      "inf");
}

TEST(ImportErrors, OptionsThatMakeNoSense) {
  const std::string text =
      Body("", R"(<geom size=".1"/>)", R"(<keyframe><key name="home" qpos="1"/></keyframe>)");
  const auto fails = [&](auto change) {
    ImportOptions options;
    change(options);
    return MustFail(text, options).Text();
  };
  EXPECT_CONTAINS(fails([](auto& o) { o.keyframe = "hoem"; }), "'home'");
  EXPECT_CONTAINS(fails([](auto& o) { o.interfaces = {"amr"}; }), "'arm'");
  EXPECT_CONTAINS(fails([](auto& o) { o.joint_pd["elbwo"] = {1, 1}; }), "'elbow'");
  EXPECT_CONTAINS(fails([](auto& o) { o.pd = PdGains{-1, 0}; }), "-1");
  EXPECT_CONTAINS(fails([](auto& o) { o.stiffness_scale = 0; }), "above 0");
  EXPECT_CONTAINS(fails([](auto& o) { o.modes = -1; }), "-1");
  EXPECT_CONTAINS(fails([](auto& o) { o.base = BaseKind::kFloating; }), "cannot be floating");
}

// 0.1 mm and 5 micrograms.
TEST(ImportErrors, BodiesBelowTheLeastMassAreToldToChangeUnits) {
  const Error error =
      MustFail(Body("", R"(<geom type="capsule" size="1e-4" fromto="0 0 0 7e-4 0 0" mass="5e-9"/>)"));
  EXPECT_EQ(error.code, ErrorCode::kModel);
  for (const char* part : {"'arm'", "mjMINVAL = 1e-15 kg and 1e-15 kg m²", "millimetres and grams"})
    EXPECT_CONTAINS(error.Text(), part);
}

std::string Hand(const std::string& besides) {
  const auto finger = [](const std::string& name) {
    return "<body name='" + name + "' pos='.1 0 0'><geom size='.01'/><body name='" + name +
           "_tip' pos='0 0 .1'>" + "<joint name='" + name +
           "' axis='0 1 0'/><geom size='.02'/></body></body>";
  };
  return "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 .1' pos='0 0 -1'/>" + besides +
         finger("left") + finger("right") + "</worldbody></mujoco>";
}

TEST(ImportErrors, SeveralFixedTreesHaveNoBaseThatFloats) {
  ImportOptions options;
  options.base = BaseKind::kFloating;
  const std::string palm = "<body name='palm' pos='.1 0 -.06'><geom size='.05'/></body>";
  for (const std::string& besides : {std::string(), palm + "<body name='table'><geom size='.1'/></body>"}) {
    const Error error = MustFail(Hand(besides), options);
    EXPECT_EQ(error.code, ErrorCode::kModel);
    for (const char* part : {"test.xml, option base", "'left' and 'right'", "into one <body>"})
      EXPECT_CONTAINS(error.Text(), part);
    EXPECT_EQ(error.message.find("'table'") != std::string::npos, !besides.empty());
    EXPECT_EQ(MustLoad(Hand(besides)).scene.mechanisms.size(), 2u);
  }
}

// Spheres of 0.5 m and 0.01 m: 0.02 m between them is more than the smaller radius, 0.005 m is not.
TEST(ImportErrors, OnlyABodyAtAllTreesIsTheirBase) {
  ImportOptions options;
  options.base = BaseKind::kFloating;
  const auto table = [](const std::string& x) {
    return Hand("<body name='table' pos='" + x + " 0 0'><geom size='.5'/></body>");
  };
  const Error error = MustFail(table(".63"), options);
  EXPECT_EQ(error.code, ErrorCode::kModel);
  EXPECT_CONTAINS(error.Text(), "'left' and 'right' are fixed to the world side by side");
  EXPECT_CONTAINS(error.Text(), "into one <body>");
  EXPECT_EQ(MustLoad(table(".615"), options).scene.mechanisms[0].name, "table");
  // At the anchors of joints alone, and beside a table that is elsewhere.
  const auto arm = [](const std::string& name, const std::string& x) {
    return "<body name='" + name + "' pos='" + x + " 0 0'><joint name='" + name +
           "' axis='0 1 0'/><geom size='.05' pos='0 0 .5'/></body>";
  };
  const auto torso = [&](const std::string& x) {
    return "<mujoco><worldbody><body name='table' pos='1 0 0'><geom size='.3'/></body>"
           "<body name='torso'><geom type='box' size='.1 .1 .1'/></body>" +
           arm("left", "-.1") + arm("right", x) + "</worldbody></mujoco>";
  };
  const ImportedScene two_arms = MustLoad(torso(".1"), options);
  ASSERT_EQ(two_arms.scene.mechanisms.size(), 1u);
  EXPECT_EQ(two_arms.scene.mechanisms[0].name, "torso");
  EXPECT_EQ(two_arms.scene.world.size(), 1u);
  EXPECT_CONTAINS(MustFail(torso(".9"), options).Text(), "into one <body>");
}

// A cube that is welded to the palm.
TEST(ImportPoses, WhatIsWeldedToASharedBaseFloatsWithIt) {
  ImportOptions options;
  options.base = BaseKind::kFloating;
  std::string text = Hand(
      "<body name='palm' pos='.1 0 -.06'><geom size='.05'/></body>"
      "<body name='cube' pos='.1 0 -.13'><freejoint name='cube'/><geom size='.01'/></body>");
  text.insert(text.find("</mujoco>"), "<equality><weld body1='palm' body2='cube'/></equality>");
  const ImportedScene loaded = MustLoad(text, options);
  ASSERT_EQ(loaded.scene.mechanisms.size(), 1u);
  EXPECT_TRUE(loaded.scene.free_bodies.empty());
  const MechanismDef& hand = loaded.scene.mechanisms[0];
  EXPECT_EQ(hand.base, BaseKind::kFloating);
  EXPECT_EQ(hand.bodies[0].name, "palm");
  EXPECT_EQ(hand.bodies.size(), 6u);
  EXPECT_EQ(MustBuild(hand).num_coordinates(), 2 + 6);
}

// The palm, which the file fixes to the world beside the fingers; a floor is none.
TEST(ImportPoses, WhatIsFixedBesideTreesFloatsWithThem) {
  ImportOptions options;
  options.base = BaseKind::kFloating;
  const std::string text = Hand(
      "<body name='palm' pos='.1 0 -.06'><geom size='.05'/></body>"
      "<body name='ground'><geom type='plane' size='1 1 1' pos='0 0 -2'/></body>");
  const ImportedScene fixed = MustLoad(text), floating = MustLoad(text, options);
  ASSERT_EQ(floating.scene.mechanisms.size(), 1u);
  const MechanismDef& hand = floating.scene.mechanisms[0];
  EXPECT_EQ(hand.base, BaseKind::kFloating);
  EXPECT_EQ(hand.bodies[0].name, "palm");
  EXPECT_EQ(hand.bodies[0].geometries.size(), 1u);
  EXPECT_EQ(hand.bodies.size(), 5u);
  EXPECT_EQ(floating.scene.world.size(), 2u);
  EXPECT_TRUE(HasNote(floating.report, ImportNote::Kind::kChosen,
                      "'palm': floats as the one base of 'left' and 'right'"));
  const Mechanism mechanism = MustBuild(hand);
  EXPECT_EQ(mechanism.num_coordinates(), 2);
  // Where the file has them.
  const RigidTransform X_WB = hand.X_WR * mechanism.body(mechanism.FindBody("left_tip")).X_RB0;
  EXPECT_LT((X_WB.translation() - Vector3(.1, 0, .1)).norm(), 1e-12);
  ASSERT_EQ(fixed.scene.world.size(), 3u);
  EXPECT_EQ(fixed.scene.world[1].name, "palm/geom1");
}

// The floor has the name that the table's shape is given for its place in the file.
TEST(ImportPoses, NamesOfStillShapesAreNoOthers) {
  const ImportedScene loaded = MustLoad(R"(<mujoco><worldbody><geom name="geom1" type="plane" size="1 1 .1"/>
    <body name="table" pos="0 0 1"><geom size=".1"/><site name="eye" pos="0 0 -.2" euler="180 0 0"/></body>
    <body name="arm" pos="1 0 1"><joint axis="0 1 0"/><geom size=".1"/></body></worldbody>
    <sensor><rangefinder name="height" site="eye"/></sensor></mujoco>)");
  ASSERT_EQ(loaded.scene.world.size(), 2u);
  EXPECT_EQ(loaded.scene.world[0].name, "geom1");
  EXPECT_EQ(loaded.scene.world[1].name, "table/geom1");
  ASSERT_EQ(loaded.scene.sensors.size(), 1u);
  EXPECT_EQ(loaded.scene.sensors[0].unseen, std::vector<int>{1});  // it sees the floor
}

}  // namespace
}  // namespace fork1s::testing_importer
