// Interfaces, base, PD control, keyframes as initial states.
#include "importer/model_copy.hpp"

#include <fmt/format.h>

#include "helpers.hpp"

namespace fork1s::testing_importer {
namespace {

constexpr const char* kHand = R"(<mujoco><compiler angle="radian"/><worldbody>
  <body name="palm"><geom size=".1"/>
    <body name="f1" pos=".2 0 0"><joint name="f1j"/><geom size=".02"/>
      <body name="f1tip" pos=".1 0 0"><joint name="f1k" stiffness="2"/><geom size=".02"/>
        <body name="nail" pos=".02 0 0"><geom size=".01" contype="0" conaffinity="0"/></body></body></body>
    <body name="f2" pos="-.2 0 0"><joint name="f2j"/><geom size=".02"/>
      <body name="flag" pos=".1 0 0"><joint name="f2k"/><geom size=".02" contype="0" conaffinity="0"/></body></body>
  </body></worldbody>
  <actuator><motor name="m1" joint="f1j" ctrllimited="true" ctrlrange="-1 1"/></actuator>
  <keyframe><key name="home" qpos=".1 .2 .3 .4" ctrl=".5"/><key name="far" qpos="1 1 1 1" ctrl="7"/></keyframe>
  <custom><numeric name="fork1s_modes" data="7"/></custom></mujoco>)";

TEST(ImportOptionsTest, ChoosesAllCollidersOfASmallMechanism) {
  const ImportedScene loaded = MustLoad(kHand);
  const MechanismDef& hand = loaded.scene.mechanisms[0];
  // The base always touches, and a nail without collision does not count.
  EXPECT_EQ(hand.interfaces, (std::vector<std::string>{"f1", "f1tip", "f2"}));
  EXPECT_FALSE(hand.interfaces_chosen);
  EXPECT_EQ(hand.modes, 7);
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChosen,
                      "'f1', 'f1tip' and 'f2': all bodies with colliding shapes"));
  EXPECT_FALSE(HasNote(loaded.report, ImportNote::Kind::kChosen, "touches nothing"));
  EXPECT_EQ(loaded.initial_keyframe, -1);
}

// `chains` chains of `links` hinges on one base.
std::string Chains(int chains, int links) {
  std::string text = "<mujoco><worldbody><body name='base'><geom size='.1'/>";
  for (int c = 0; c < chains; ++c) {
    for (int l = 0; l < links; ++l)
      text += fmt::format(
          "<body name='c{0}l{1}' pos='{2} 0 .1'><joint name='c{0}j{1}' stiffness='1'/><geom size='.02'/>", c,
          l, l == 0 ? c : 0);
    for (int l = 0; l < links; ++l) text += "</body>";
  }
  return text + "</body></worldbody></mujoco>";
}

// 24 coordinates, or 12 for each outermost body.
TEST(ImportOptionsTest, ChoosesTheOutermostCollidersOfALargeMechanism) {
  EXPECT_EQ(MustLoad(Chains(1, 24)).scene.mechanisms[0].interfaces.size(), 24u);
  const ImportedScene loaded = MustLoad(Chains(1, 25));
  EXPECT_EQ(loaded.scene.mechanisms[0].interfaces, (std::vector<std::string>{"c0l24"}));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChosen, "24 more with such shapes touch nothing"));
  EXPECT_EQ(MustLoad(Chains(3, 12)).scene.mechanisms[0].interfaces.size(), 36u);
  EXPECT_EQ(MustLoad(Chains(3, 13)).scene.mechanisms[0].interfaces.size(), 3u);
}

TEST(ImportOptionsTest, ChoosesLeavesWhereNothingCollides) {
  std::string text = kHand;
  for (std::size_t at; (at = text.find("<geom size=\".02\"/>")) != std::string::npos;) {
    text.replace(at, 18, "<geom size=\".02\" contype=\"0\" conaffinity=\"0\"/>");
  }
  EXPECT_EQ(MustLoad(text).scene.mechanisms[0].interfaces, (std::vector<std::string>{"nail", "flag"}));
}

TEST(ImportOptionsTest, OptionsWin) {
  ImportOptions options;
  options.interfaces = {"flag", "palm", "flag"};
  options.modes = 2;
  options.base = BaseKind::kDriven;
  const ImportedScene loaded = MustLoad(kHand, options);
  const MechanismDef& hand = loaded.scene.mechanisms[0];
  EXPECT_EQ(hand.interfaces, (std::vector<std::string>{"flag", "palm"}));
  EXPECT_TRUE(hand.interfaces_chosen);
  EXPECT_EQ(hand.modes, 2);
  EXPECT_EQ(hand.base, BaseKind::kDriven);
}

TEST(ImportOptionsTest, ModeChoiceOfTheFileAndOfTheOption) {
  std::string text = kHand;
  EXPECT_EQ(MustLoad(text).scene.mechanisms[0].mode_choice, ModeChoice::kLowest);
  text.replace(text.find("<custom>"), 8, R"(<custom><text name="fork1s_mode_choice" data="contribution"/>)");
  EXPECT_EQ(MustLoad(text).scene.mechanisms[0].mode_choice, ModeChoice::kContribution);
  ImportOptions options;
  options.mode_choice = ModeChoice::kLowest;
  EXPECT_EQ(MustLoad(text, options).scene.mechanisms[0].mode_choice, ModeChoice::kLowest);
}

TEST(ImportOptionsTest, NamesGoToTheMechanismThatOwnsThem) {
  const ImportedScene loaded = MustLoad(R"(<mujoco><worldbody>
    <body name="a"><joint/><geom size=".1"/></body><body name="b"><joint/><geom size=".1"/></body>
    <body name="ball" pos="0 0 2"><freejoint/><geom size=".1"/></body></worldbody>
    <custom><text name="fork1s_interface" data="b a"/></custom></mujoco>)");
  ASSERT_EQ(loaded.scene.mechanisms.size(), 2u);
  EXPECT_EQ(loaded.scene.mechanisms[0].interfaces, std::vector<std::string>{"a"});
  EXPECT_EQ(loaded.scene.mechanisms[1].interfaces, std::vector<std::string>{"b"});
}

TEST(ImportOptionsTest, PdHoldsMotorisedJointsAtTheInitialPose) {
  ImportOptions options;
  options.pd = PdGains{30, 2};
  options.keyframe = "home";
  options.joint_pd["f1k"] = {6, .5};
  const ImportedScene loaded = MustLoad(kHand, options);
  EXPECT_EQ(loaded.initial_keyframe, 0);
  const MechanismDef& hand = loaded.scene.mechanisms[0];
  const FreedomDef& driven = hand.joints[hand.FindJoint("f1j").u()].freedoms[0];
  EXPECT_EQ(driven.stiffness, 30);
  EXPECT_EQ(driven.damping, 2);
  EXPECT_NEAR(driven.rest, .1, 1e-15);
  // Its own spring 2 rests at 0, PD control 6 at the keyframe's 0.2.
  const FreedomDef& sprung = hand.joints[hand.FindJoint("f1k").u()].freedoms[0];
  EXPECT_EQ(sprung.stiffness, 8);
  EXPECT_NEAR(sprung.rest, 6 * .2 / 8, 1e-15);
  EXPECT_EQ(hand.joints[hand.FindJoint("f2j").u()].freedoms[0].stiffness, 0);
  ASSERT_EQ(hand.controls.size(), 2u);  // the motor is gone
  EXPECT_EQ(hand.controls[0].name, "f1j");
  EXPECT_TRUE(hand.controls[0].is_setpoint);
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChanged, "'m1'"));
  // The other keyframe is held at its own pose.
  const auto& far = loaded.scene.keyframes[1].mechanisms[0];
  ASSERT_EQ(far.controls.size(), 2);
  EXPECT_NEAR(far.controls[0], .9, 1e-15);
  EXPECT_NEAR(far.controls[1], .8, 1e-15);
}

TEST(ImportOptionsTest, PdOfANamedJoint_ReplacesTheGeneralGainsAndItsMotor) {
  const std::string arm = R"(<mujoco><worldbody><body><joint name="a" axis="0 1 0"/><geom size=".1"/>
    <body pos="1 0 0"><joint name="b" axis="0 1 0" damping=".25"/><geom size=".1"/></body></body></worldbody>
    <actuator><motor joint="a"/><motor joint="b"/></actuator></mujoco>)";
  ImportOptions options;
  options.pd = PdGains{30, 2};
  options.joint_pd["b"] = {500, 7};
  const ImportedScene loaded = MustLoad(arm, options);
  const MechanismDef& robot = loaded.scene.mechanisms[0];
  const FreedomDef &a = robot.joints[0].freedoms[0], &b = robot.joints[1].freedoms[0];
  EXPECT_EQ(a.stiffness, 30);
  EXPECT_EQ(b.stiffness, 500);
  EXPECT_EQ(b.damping, 7.25);
  ASSERT_EQ(robot.controls.size(), 2u);
  EXPECT_EQ(robot.controls[1].name, "b");
  EXPECT_EQ(robot.controls[1].gain, 500);
  ASSERT_EQ(loaded.report.holds.size(), 2u);
  EXPECT_EQ(loaded.report.holds[1].held_by, "PD control kp 500 N·m/rad, kv 7");
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChosen, "holds 1 freedoms: 'a'"));
}

TEST(ImportOptionsTest, PdOfAllJoints_HoldsEachAsIfItWereNamed) {
  const std::string arm = R"(<mujoco><worldbody><body name="root" pos="0 0 1"><freejoint/><geom size=".1"/>
    <body pos="1 0 0"><joint name="a" axis="0 1 0" stiffness="4"/><geom size=".1"/>
    <body pos="1 0 0"><joint name="b" axis="0 1 0"/><geom size=".1"/>
    <body pos="1 0 0"><joint name="c" type="ball"/><geom size=".1"/></body></body></body></body></worldbody>
    <actuator><motor name="a" joint="a"/><motor name="b" joint="b"/></actuator></mujoco>)";
  // Without: joint a has a spring of its own, and the note says what holds it too.
  ImportOptions options;
  options.pd = PdGains{30, 2};
  const ImportedScene some = MustLoad(arm, options);
  EXPECT_TRUE(HasNote(some.report, ImportNote::Kind::kChosen, "none of 'a', which has a spring"));
  EXPECT_TRUE(HasNote(some.report, ImportNote::Kind::kChosen, "all=KP,KV"));

  options.pd.reset();
  options.joint_pd["all"] = {30, 2};
  options.joint_pd["b"] = {500, 7};
  const ImportedScene loaded = MustLoad(arm, options);
  options.joint_pd = {{"a", {30, 2}}, {"b", {500, 7}}, {"c", {30, 2}}};
  const ImportedScene named = MustLoad(arm, options);
  const auto held = [](const ImportedScene& scene) {
    std::map<std::string, std::string> out;
    for (const auto& hold : scene.report.holds) out[hold.joint] = hold.held_by;
    return out;
  };
  EXPECT_EQ(held(loaded), held(named));
  EXPECT_EQ(held(loaded)["a"], "spring 4 N·m/rad, motor 'a', no stiffness, PD control kp 30 N·m/rad, kv 2");
  EXPECT_EQ(loaded.scene.mechanisms[0].controls.size(), 7u);  // two motors, five targets
  EXPECT_FALSE(HasNote(loaded.report, ImportNote::Kind::kChosen, "which has a spring"));

  // A joint of that name is that joint.
  const ImportedScene one = MustLoad(
      R"(<mujoco><worldbody><body><joint name="all"/><geom size=".1"/><body><joint name="d"/><geom size=".1"/></body>
    </body></worldbody></mujoco>)",
      [] {
        ImportOptions o;
        o.joint_pd["all"] = {30, 2};
        return o;
      }());
  EXPECT_EQ(one.scene.mechanisms[0].controls.size(), 1u);
}

// A velocity servo, a muscle and a motor over two joints have no position gain: the spring is why gains skip a joint.
TEST(ImportOptionsTest, PdNamesJointsThatItSkipsForTheirSpring_ButNotThoseOfPositionServos) {
  ImportOptions options;
  options.pd = PdGains{30, 2};
  std::string chain = R"(<mujoco><worldbody>
    <body><joint name="v" axis="0 1 0" stiffness="4"/><geom size=".1"/>
    <body pos="1 0 0"><joint name="m" axis="0 1 0" stiffness="4" range="-1 1"/><geom size=".1"/>
    <body pos="1 0 0"><joint name="t" axis="0 1 0" stiffness="4"/><geom size=".1"/>
    <body pos="1 0 0"><joint name="p" axis="0 1 0" stiffness="4"/><geom size=".1"/>
    <body pos="1 0 0"><joint name="bare" axis="0 1 0"/><geom size=".1"/></body></body></body></body></body></worldbody>
    <tendon><fixed name="both"><joint joint="t" coef="1"/><joint joint="v" coef="1"/></fixed></tendon>
    <actuator><velocity joint="v" kv="2"/><muscle joint="m" lengthrange="-1 1"/><motor tendon="both"/>
      <position joint="p" kp="9"/></actuator></mujoco>)";
  const ImportedScene loaded = MustLoad(chain, options);
  EXPECT_TRUE(
      HasNote(loaded.report, ImportNote::Kind::kChosen, "none of 'v', 'm' and 't', which have a spring"));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChosen, "holds 1 freedoms: 'bare'"));

  // A spring that only bends is one too.
  std::string bends = chain;
  bends.replace(bends.find("stiffness=\"4\""), 13, "stiffness=\"0 5 0\"");
  EXPECT_TRUE(
      HasNote(MustLoad(bends, options).report, ImportNote::Kind::kChosen, "none of 'v', 'm' and 't'"));

  // Springs that the file disables hold nothing, and the gains hold their joints.
  chain.insert(8, R"(<option><flag spring="disable"/></option>)");
  const ImportedScene slack = MustLoad(chain, options);
  EXPECT_FALSE(HasNote(slack.report, ImportNote::Kind::kChosen, "a spring; gains of all"));
  EXPECT_TRUE(HasNote(slack.report, ImportNote::Kind::kChosen, "holds 3 freedoms: 'v', 't' and 'bare'"));
}

TEST(ImportOptionsTest, PdOfALoopWithoutMotors_OffersAllOnlyWhereItIsNotGiven) {
  const std::string loop = R"(<mujoco><worldbody>
    <body name="a"><joint axis="0 1 0"/><geom size=".1" pos=".5 0 0"/></body>
    <body name="b" pos="2 0 0"><joint axis="0 1 0"/><geom size=".1" pos="-.5 0 0"/>
      <body name="c" pos="-1 0 0"><joint axis="0 1 0"/><geom size=".1"/></body></body></worldbody>
    <equality><connect body1="a" body2="c" anchor="1 0 0"/></equality></mujoco>)";
  ImportOptions options;
  options.pd = PdGains{30, 2};
  EXPECT_TRUE(HasNote(MustLoad(loop, options).report, ImportNote::Kind::kChosen, "all joints, all=KP,KV"));
  options.joint_pd["all"] = {40, 3};
  const ImportedScene held = MustLoad(loop, options);
  EXPECT_FALSE(HasNote(held.report, ImportNote::Kind::kChosen, "all=KP,KV"));
  EXPECT_EQ(held.scene.mechanisms[0].controls.size(), 3u);
}

TEST(ImportOptionsTest, PdHoldsAllUnsprungJointsWithoutMotors) {
  std::string text = kHand;
  text.replace(text.find("<actuator>"), text.find("</actuator>") + 11 - text.find("<actuator>"), "");
  text.replace(text.find(" ctrl=\".5\""), 10, "");
  text.replace(text.find(" ctrl=\"7\""), 9, "");
  ImportOptions options;
  options.pd = PdGains{30, 2};
  options.stiffness_scale = 4;
  const ImportedScene loaded = MustLoad(text, options);
  const MechanismDef& hand = loaded.scene.mechanisms[0];
  EXPECT_EQ(hand.joints[hand.FindJoint("f2k").u()].freedoms[0].stiffness, 120);
  EXPECT_EQ(hand.joints[hand.FindJoint("f2k").u()].freedoms[0].damping, 4);
  EXPECT_EQ(hand.joints[hand.FindJoint("f1k").u()].freedoms[0].stiffness, 8);
  EXPECT_EQ(hand.controls.size(), 3u);
}

TEST(ImportOptionsTest, KeyframeControlsStayInRange) {
  ImportOptions options;
  options.keyframe = "far";
  const ImportedScene loaded = MustLoad(kHand, options);
  EXPECT_EQ(loaded.initial_keyframe, 1);
  EXPECT_EQ(loaded.scene.mechanisms[0].controls[0].initial, 1);
}

constexpr const char* kIntegrated = R"(<mujoco><worldbody>
    <body name="b"><joint name="j"/><joint name="k" axis="0 1 0"/><geom size=".1"/></body></worldbody>
    <actuator><position name="p" joint="k" kp="3"/>
      <intvelocity name="v" joint="j" kp="50" kv="2" actrange="-2 2"/></actuator>
    <keyframe><key name="bent" time="1.5" qpos=".7 .1" act=".6" ctrl=".2 .4"/></keyframe></mujoco>)";

// The activation of an integrator is the set-point; its control is the rate of that.
TEST(ImportOptionsTest, KeyframeOfAnIntegrator_StartsAtTheActivation) {
  ImportOptions options;
  options.keyframe = "bent";
  const ImportedScene loaded = MustLoad(kIntegrated, options);
  const MechanismDef& mechanism = loaded.scene.mechanisms[0];
  ASSERT_EQ(mechanism.controls.size(), 2u);
  EXPECT_EQ(mechanism.controls[0].initial, .2);
  EXPECT_EQ(mechanism.controls[1].initial, .4);
  EXPECT_EQ(mechanism.controls[1].initial_activation, .6);
  const KeyframeDef::MechanismState& state = loaded.scene.keyframes[0].mechanisms[0];
  ASSERT_EQ(state.activation.size(), 2);
  EXPECT_EQ(state.activation(1), .6);
  const auto text = MomentAsMjcf(WriteFile("m.xml", kIntegrated), {}, loaded.scene.keyframes[0], "now", 2);
  ASSERT_TRUE(text) << text.error().Text();
  EXPECT_CONTAINS(*text, R"(act="0.6" ctrl="0.2 0.4")");
}

TEST(ImportOptionsTest, ActuatorsOfADisabledGroup_AreLeftOut) {
  const ImportedScene loaded = MustLoad(R"(<mujoco><option actuatorgroupdisable="2 4"/><worldbody>
    <body name="b"><joint name="j"/><geom size=".1"/></body></worldbody>
    <actuator><position name="on" joint="j" kp="3"/><position name="off" joint="j" kp="5" group="2"/>
      <motor name="idle" joint="j" group="4"/><motor name="third" joint="j" group="3"/></actuator></mujoco>)");
  const MechanismDef& mechanism = loaded.scene.mechanisms[0];
  ASSERT_EQ(mechanism.controls.size(), 2u);
  EXPECT_EQ(mechanism.controls[1].name, "third");
  EXPECT_EQ(mechanism.joints[0].freedoms[0].stiffness, 3);
  for (const char* name : {"'off'", "'idle'"})
    EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, name)) << name;
}

TEST(ImportOptionsTest, ShapesAndTheirContactData) {
  const ImportedScene loaded = MustLoad(R"(<mujoco><asset>
    <material name="red" rgba="1 0 0 1"/>
    <hfield name="hill" nrow="3" ncol="4" size="2 1 .5 .1"/>
    <mesh name="tet" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/></asset>
    <worldbody><geom type="hfield" hfield="hill"/>
    <body name="a" pos="0 0 2"><joint/><geom name="s" size=".1" material="red" friction=".3" condim="1" priority="2" group="3"/>
      <geom name="e" type="ellipsoid" size=".1 .2 .3" rgba="0 1 0 .5" contype="2" conaffinity="4"/>
      <geom name="m" type="mesh" mesh="tet"/></body></worldbody></mujoco>)");
  const auto& shapes = loaded.scene.mechanisms[0].bodies[1].geometries;
  ASSERT_EQ(shapes.size(), 3u);
  EXPECT_EQ(shapes[0].rgba, Vector4(1, 0, 0, 1));
  EXPECT_TRUE(shapes[0].frictionless);
  EXPECT_EQ(shapes[0].friction, .3);
  EXPECT_EQ(shapes[0].priority, 2);
  EXPECT_EQ(shapes[0].group, 3);
  EXPECT_EQ(shapes[1].contype, 2);
  EXPECT_EQ(shapes[1].conaffinity, 4);
  EXPECT_EQ(std::get<Ellipsoid>(shapes[1].shape).radii, Vector3(.1, .2, .3));
  // MuJoCo moves a mesh to its centre of mass; in the body the vertices are where the file put them.
  const auto& mesh = *std::get<MeshShape>(shapes[2].shape).mesh;
  ASSERT_EQ(mesh.vertices.size(), 4u);
  EXPECT_EQ(mesh.triangles.size(), 4u);
  double nearest = 1;
  for (const auto& v : mesh.vertices) {
    nearest = std::min(nearest, (shapes[2].X_BG * Vector3(v.cast<double>()) - Vector3(0, 0, 1)).norm());
  }
  EXPECT_LT(nearest, 1e-6);
  const auto& hill = *std::get<HeightField>(loaded.scene.world[0].shape).grid;
  EXPECT_EQ(hill.rows, 3);
  EXPECT_EQ(hill.columns, 4);
  EXPECT_EQ(hill.half_x, 2);
  EXPECT_EQ(hill.values.size(), 12u);
}

// A damping ratio below 1 bounces, whether it is named or follows from stiffness and damping.
TEST(ImportOptionsTest, SolrefSaysWhatBounces) {
  const ImportedScene loaded = MustLoad(R"(<mujoco><worldbody><geom type="plane" size="1 1 1"/>
    <geom name="lively" size=".1" pos="0 0 1" solref=".02 .2"/>
    <geom name="direct" size=".1" pos="0 0 2" solref="-2500 -20"/>
    <geom name="damped" size=".1" pos="0 0 3" solref=".02 1.5"/>
    <body pos="0 0 5"><freejoint/><geom size=".1"/></body></worldbody></mujoco>)");
  const auto& world = loaded.scene.world;
  ASSERT_EQ(world.size(), 4u);
  EXPECT_EQ(world[0].restitution, 0);
  // exp(-π ζ/√(1 - ζ²)) for ζ = 0.2: 20/(2 √2500) in the second.
  EXPECT_NEAR(world[1].restitution, std::exp(-M_PI * 0.2 / std::sqrt(0.96)), 1e-12);
  EXPECT_NEAR(world[2].restitution, world[1].restitution, 1e-12);
  EXPECT_EQ(world[3].restitution, 0);
}

}  // namespace
}  // namespace fork1s::testing_importer
