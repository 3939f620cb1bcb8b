// Where a model starts by options: base pose, joint coordinates, ground.
#include <cmath>
#include <cstdio>

#include "helpers.hpp"
#include "urdf_text.hpp"

namespace fork1s::testing_importer {
namespace {

using Kind = ImportNote::Kind;

constexpr double kRounding = 1e-12;  // rad, m: a few products of numbers of order 1

const KeyframeDef& StartOf(const ImportedScene& loaded) {
  if (loaded.initial_keyframe < 0) throw std::runtime_error("no keyframe is the initial one");
  return loaded.scene.keyframes[static_cast<std::size_t>(loaded.initial_keyframe)];
}

// A trunk with a foot on a knee, below it by 0.5 m.
std::string Hopper() {
  const std::string ball = Part("collision", R"(<sphere radius=".05"/>)");
  return Robot(
      Link("trunk", kInertial + ball) + Link("foot", kInertial + ball) +
      Joint(
          "knee", "revolute", "trunk", "foot",
          R"(<axis xyz="0 1 0"/><origin xyz="0 0 -.5"/><limit lower="-1" upper="2" effort="1" velocity="1"/>)"));
}

ImportOptions Floating() {
  ImportOptions options;
  options.base = BaseKind::kFloating;
  return options;
}

TEST(ImportStart, GroundLiesUnderAFloatingRobot) {
  ImportOptions options = Floating();
  EXPECT_TRUE(
      HasNote(MustLoad(Hopper(), options).report, Kind::kChosen, "nothing to fall on; the option ground"));
  EXPECT_FALSE(HasNote(MustLoad(Hopper()).report, Kind::kChosen, "nothing to fall on"));
  options.ground = true;
  const ImportedScene loaded = MustLoad(Hopper(), options);
  EXPECT_FALSE(HasNote(loaded.report, Kind::kChosen, "nothing to fall on"));
  ASSERT_EQ(loaded.scene.world.size(), 1u);
  EXPECT_TRUE(std::holds_alternative<Plane>(loaded.scene.world[0].shape));
  EXPECT_TRUE(loaded.scene.world[0].Collides());
  EXPECT_NEAR(loaded.scene.world[0].X_BG.translation().z(), -.55, kRounding);  // the foot's ball
  EXPECT_TRUE(HasNote(loaded.report, Kind::kChosen, "the lowest point of the model touches it"));
}

TEST(ImportStart, GroundIsAtZeroOrWhereAskedBelowABasePose) {
  ImportOptions options = Floating();
  options.ground = true;
  options.base_pose = RigidTransform(Vector3(1, 2, .7));
  const ImportedScene zero = MustLoad(Hopper(), options);
  EXPECT_EQ(zero.scene.world[0].X_BG.translation().z(), 0);
  EXPECT_TRUE(HasNote(zero.report, Kind::kChosen, "is 0.15 m above it"));
  options.ground_height = .25;
  const ImportedScene asked = MustLoad(Hopper(), options);
  EXPECT_EQ(asked.scene.world[0].X_BG.translation().z(), .25);
  EXPECT_TRUE(HasNote(asked.report, Kind::kChosen, "is 0.1 m below it: raise the model"));
}

TEST(ImportStart, GroundFollowsTheInitialPoseOfEveryShape) {
  // Each shape turned by 0.7 rad about an axis that is none of its own, against points on its surface.
  const Vector3 axis = Vector3(.6, .48, .64);
  const RigidTransform X(ExpRotation(.7 * axis), Vector3(.1, .2, .3));
  const Vector3 down = X.rotation().transpose() * Vector3(0, 0, -1);
  const double r = .1, half = .2;
  const double across = down.head<2>().norm(), along = std::abs(down.z());
  const std::pair<std::string, double> shapes[] = {
      {R"(type="sphere" size=".1")", r},
      {R"(type="capsule" size=".1 .2")", r + half * along},
      {R"(type="cylinder" size=".1 .2")", r * across + half * along},
      {R"(type="box" size=".1 .2 .3")", .1 * std::abs(down.x()) + .2 * std::abs(down.y()) + .3 * along},
      {R"(type="ellipsoid" size=".1 .2 .3")", Vector3(.1 * down.x(), .2 * down.y(), .3 * down.z()).norm()},
      {R"(type="mesh" mesh="m")",
       std::max({0., .1 * down.x(), .2 * down.y(), .3 * down.z()})},  // its corners
  };
  for (const auto& [shape, extent] : shapes) {
    SCOPED_TRACE(shape);
    ImportOptions options;
    options.base_pose = X;
    options.ground = true;
    options.ground_height = 0;
    const ImportedScene loaded = MustLoad(
        R"(<mujoco><compiler inertiafromgeom="false"/><asset><mesh name="m" vertex="0 0 0 .1 0 0 0 .2 0 0 0 .3"/></asset>
        <worldbody><body name="b"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom )" +
            shape +
            R"(/><body name="flag"><joint name="j"/><inertial pos="0 0 .1" mass="1" diaginertia="1 1 1"/></body>
        </body></worldbody></mujoco>)",
        options);
    char expected[40];
    std::snprintf(expected, sizeof expected, "is %.4g m", std::abs(.3 - extent));
    EXPECT_TRUE(HasNote(loaded.report, Kind::kChosen, expected)) << expected;
  }
}

TEST(ImportStart, GroundIsRefusedWhereItMeansNothing) {
  ImportOptions options;
  options.ground = true;
  const Error twice = MustFail(R"(<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
      <body><joint/><geom size=".1"/></body></worldbody></mujoco>)",
                               options);
  EXPECT_EQ(twice.code, ErrorCode::kUsage);
  EXPECT_CONTAINS(twice.message, "'floor'");
  EXPECT_CONTAINS(MustFail(Arm(kInertial), options).message, "no shape of the model can touch it");
}

TEST(ImportStart, BodiesThatPassThroughTheGroundAreNamed) {
  ImportOptions options = Floating();
  options.ground = true;
  const std::string ball = Part("collision", R"(<sphere radius=".05"/>)");
  // A drooping shin between trunk and foot, lower than both.
  const std::string low = Robot(
      Link("trunk", kInertial + ball) + Link("foot", kInertial + ball) +
      Link("shin", kInertial + Part("collision", R"(<sphere radius=".05"/>)", R"(<origin xyz="0 0 -1"/>)")) +
      Joint("hip", "continuous", "trunk", "shin") + Joint("ankle", "continuous", "shin", "foot"));
  const ImportedScene loaded = MustLoad(low, options);
  EXPECT_NEAR(loaded.scene.world[0].X_BG.translation().z(), -1.05, kRounding);
  EXPECT_FALSE(HasNote(loaded.report, Kind::kChosen, "passes through"));
  options.interfaces = {"foot"};
  EXPECT_TRUE(HasNote(MustLoad(low, options).report, Kind::kChosen, "body 'shin', which passes through it"));
}

TEST(ImportStart, BasePoseOfEveryKindOfBase) {
  const RigidTransform X(ExpRotation(Vector3(.3, -.2, .5)), Vector3(1, 2, 3));
  ImportOptions options;
  options.base_pose = X;
  for (const auto& base : {BaseKind::kFixed, BaseKind::kFloating, BaseKind::kDriven}) {
    options.base = base;
    EXPECT_LT(PoseDifference(MustLoad(Hopper(), options).scene.mechanisms[0].X_WR, X), kRounding);
  }
  // A keyframe's own pose gives way, its velocity stays; other keyframes keep theirs.
  const std::string free = R"(<mujoco><worldbody><body name="b"><freejoint/><geom size=".1"/>
    <body name="f"><joint name="j"/><geom size=".1"/></body></body></worldbody>
    <keyframe><key name="up" qpos="0 0 5 1 0 0 0 .4" qvel="1 0 0 0 0 0 0"/><key name="other" qpos="0 0 6 1 0 0 0 0"/></keyframe></mujoco>)";
  options.base.reset();
  options.keyframe = "up";
  const ImportedScene loaded = MustLoad(free, options);
  EXPECT_EQ(loaded.initial_keyframe, 0);
  EXPECT_LT(PoseDifference(StartOf(loaded).mechanisms[0].X_WR, X), kRounding);
  EXPECT_EQ(StartOf(loaded).mechanisms[0].q[0], .4);
  EXPECT_EQ(loaded.scene.keyframes[1].mechanisms[0].X_WR.translation().z(), 6);
}

TEST(ImportStart, BasePoseIsRefusedWhereItMeansNothing) {
  ImportOptions options;
  options.base_pose = RigidTransform(Vector3(0, 0, 1));
  const auto refused = [&](const std::string& mjcf) {
    const Error error = MustFail(mjcf, options);
    EXPECT_EQ(error.code, ErrorCode::kUsage);
    EXPECT_CONTAINS(error.where, "option base-pose");
    return error.message;
  };
  EXPECT_CONTAINS(refused(R"(<mujoco><worldbody><body name="a"><joint/><geom size=".1"/></body>
      <body name="b" pos="1 0 0"><joint/><geom size=".1"/></body></worldbody></mujoco>)"),
                  "2 movable parts");
  EXPECT_CONTAINS(
      refused(R"(<mujoco><worldbody><body name="a"><joint/><geom size=".1"/></body></worldbody></mujoco>)"),
      "stands on the world itself");
  EXPECT_CONTAINS(refused(R"(<mujoco><worldbody><body name="a"><geom size=".1"/><body name="c"><joint/>
      <geom size=".1"/></body></body></worldbody><equality><connect name="tie" body1="c" anchor="0 0 .1"/></equality></mujoco>)"),
                  "equality 'tie'");
}

TEST(ImportStart, JointCoordinatesAreAKeyframe) {
  ImportOptions options;
  options.joint_coordinates = {{"knee", .7}};
  options.pd = PdGains{30, 1};
  const ImportedScene loaded = MustLoad(Hopper(), options);
  EXPECT_EQ(StartOf(loaded).mechanisms[0].q[0], .7);
  // PD control holds the pose in which the model starts.
  const MechanismDef& robot = loaded.scene.mechanisms[0];
  EXPECT_NEAR(robot.joints[0].freedoms[0].rest, .7, kRounding);
  ASSERT_EQ(StartOf(loaded).mechanisms[0].controls.size(), 1);
  EXPECT_EQ(StartOf(loaded).mechanisms[0].controls[0], 0);
  // The file's own count: a ref shifts it, and a keyframe gives the rest.
  options.pd.reset();
  options.keyframe = "k";
  options.joint_coordinates = {{"slide", .3}};
  const ImportedScene mjcf =
      MustLoad(R"(<mujoco><compiler angle="radian"/><worldbody><body name="a"><geom size=".1"/>
      <body name="b"><joint name="slide" type="slide" axis="1 0 0" ref=".1"/><geom size=".1"/>
      <body name="c"><joint name="turn" axis="0 1 0"/><geom size=".1"/></body></body></body></worldbody>
      <keyframe><key name="k" qpos=".5 .6"/><key name="start" qpos="0 0"/></keyframe></mujoco>)",
               options);
  EXPECT_EQ(mjcf.scene.keyframes.size(), 3u);
  EXPECT_EQ(StartOf(mjcf).name, "start_");
  EXPECT_NEAR(StartOf(mjcf).mechanisms[0].q[0], .2, kRounding);
  EXPECT_NEAR(StartOf(mjcf).mechanisms[0].q[1], .6, kRounding);
}

TEST(ImportStart, JointCoordinatesAreChecked) {
  const auto with = [](const std::string& name, double value) {
    ImportOptions options = Floating();
    options.joint_coordinates[name] = value;
    return options;
  };
  const Error unknown = MustFail(Hopper(), with("knie", 0));
  EXPECT_EQ(unknown.code, ErrorCode::kUsage);
  EXPECT_CONTAINS(unknown.Text(),
                  "option q 'knie': no mechanism has a joint of that name; near names are 'knee'");
  EXPECT_CONTAINS(MustFail(Hopper(), with("world_to_root", 0)).message, "base pose");
  EXPECT_CONTAINS(MustFail(Hopper(), with("knee", std::nan(""))).message, "not finite");
  EXPECT_TRUE(
      HasNote(MustLoad(Hopper(), with("knee", 30)).report, Kind::kChosen,
              "option q 'knee': 30 rad is outside its limits -1 to 2 rad: it starts at the nearest, 2 rad"));
  EXPECT_FALSE(HasNote(MustLoad(Hopper(), with("knee", 2)).report, Kind::kChosen, "outside"));
  EXPECT_CONTAINS(MustFail(R"(<mujoco><worldbody><body><geom size=".1"/><body><joint name="b" type="ball"/>
      <geom size=".1"/></body></body></worldbody></mujoco>)",
                           [] {
                             ImportOptions options;
                             options.joint_coordinates["b"] = 1;
                             return options;
                           }())
                      .message,
                  "a ball joint has no single coordinate");
}

// A parallelogram: two cranks of 0.2 m joined by a rod of 0.3 m, so that both turn by the same angle.
constexpr const char* kParallelogram =
    R"(<mujoco><compiler angle="radian"/><worldbody><body name="frame"><geom size=".02"/>
  <body name="left"><joint name="l" axis="0 1 0"/><geom size=".02"/>
    <body name="rod" pos="0 0 .2"><joint name="r" axis="0 1 0"/><geom size=".02"/></body></body>
  <body name="right" pos=".3 0 0"><joint name="o" axis="0 1 0"/><geom size=".02"/></body>
  </body></worldbody>
  <equality><connect body1="rod" body2="right" anchor=".3 0 0"/></equality></mujoco>)";

TEST(ImportStart, LoopsFollowTheAskedCoordinate) {
  ImportOptions options;
  // Far enough to pass the folded pose at 90°, where the branch of a kite leaves that of the parallelogram.
  for (const double angle : {.4, -1.2, 1.9}) {
    options.joint_coordinates = {{"l", angle}};
    const ImportedScene loaded = MustLoad(kParallelogram, options);
    const MechanismDef& linkage = loaded.scene.mechanisms[0];
    const Mechanism mechanism = MustBuild(linkage);
    const VectorX& q = StartOf(loaded).mechanisms[0].q;
    Kinematics kinematics(mechanism);
    ComputeKinematics(mechanism, q, kinematics);
    EXPECT_LT(ClosureGap(mechanism, kinematics, q), 1e-12);  // of 0.3 m: rounding
    const auto at = [&](const char* name) { return q[linkage.FindJoint(name).value()]; };
    EXPECT_EQ(at("l"), angle);
    // CloseLoops stops at a gap of 1e-13 of the linkage's length.
    EXPECT_NEAR(at("o"), angle, 1e-9);
    EXPECT_NEAR(at("r"), -angle, 1e-9);
    // What creates a simulation closes the loops again, and finds nothing to do.
    VectorX again = q;
    CloseLoops(mechanism, again);
    EXPECT_LT((again - q).norm(), 1e-12);
  }
  options.joint_coordinates = {{"l", .4}, {"o", -.4}};
  const Error error = MustFail(kParallelogram, options);
  EXPECT_EQ(error.code, ErrorCode::kUsage);
  EXPECT_CONTAINS(error.message, "stay open");
  EXPECT_CONTAINS(error.message, "'l' and 'o'");
}

TEST(ImportStart, MimicsFollowTheirLeader) {
  const std::string text =
      Robot(Link("base") + Link("a") + Link("b") + Joint("ja", "continuous", "base", "a") +
            Joint("jb", "continuous", "a", "b",
                  R"(<axis xyz="0 1 0"/><mimic joint="ja" multiplier="-1.5" offset=".2"/>)"));
  ImportOptions options;
  options.joint_coordinates = {{"ja", .4}};
  EXPECT_NEAR(StartOf(MustLoad(text, options)).mechanisms[0].q[1], .2 - 1.5 * .4, 1e-9);
  options.joint_coordinates = {{"jb", .5}};
  EXPECT_NEAR(StartOf(MustLoad(text, options)).mechanisms[0].q[0], (.5 - .2) / -1.5, 1e-9);
  options.joint_coordinates = {{"ja", .4}, {"jb", .4}};
  EXPECT_CONTAINS(MustFail(text, options).message, "stay open");
}

TEST(ImportStart, FollowersWithAnOffsetStartAtIt) {
  const ImportedScene loaded =
      MustLoad(Robot(Link("base") + Link("a") + Link("b") + Joint("ja", "continuous", "base", "a") +
                     Joint("jb", "continuous", "base", "b",
                           R"(<axis xyz="0 1 0"/><mimic joint="ja" multiplier="-1" offset=".5"/>)")));
  const VectorX& q = StartOf(loaded).mechanisms[0].q;
  EXPECT_EQ(q[0], 0);
  EXPECT_NEAR(q[1], 0.5, kRounding);
}

std::string Leg(const std::string& range, const std::string& keyframe = "") {
  return R"(<mujoco><compiler angle="radian"/><worldbody><body name="trunk"><joint name="z" type="slide" axis="0 0 1"/>
    <geom size=".1"/><body name="thigh"><joint name="knee" axis="0 1 0" range=")" +
         range + R"("/>
    <geom size=".1"/></body></body></worldbody>)" +
         keyframe + "</mujoco>";
}

TEST(ImportStart, JointsStartInsideTheirLimits) {
  const ImportedScene bent = MustLoad(Leg(".5 1"));
  EXPECT_EQ(StartOf(bent).mechanisms[0].q[1], 0.5);
  EXPECT_TRUE(HasNote(bent.report, Kind::kChanged, "joint 'knee': the file starts it outside its limits"));
  const ImportedScene straight = MustLoad(Leg("-1 1"));
  EXPECT_EQ(straight.initial_keyframe, -1);
  EXPECT_FALSE(HasNote(straight.report, Kind::kChanged, "outside"));
  ImportOptions options;
  options.keyframe = "k";
  const ImportedScene keyed =
      MustLoad(Leg("-1 1", R"(<keyframe><key name="k" qpos=".2 -3" qvel="1 0"/></keyframe>)"), options);
  EXPECT_EQ(StartOf(keyed).mechanisms[0].q[1], -1);
  EXPECT_EQ(StartOf(keyed).mechanisms[0].q[0], 0.2);
  EXPECT_EQ(StartOf(keyed).mechanisms[0].q_dot[0], 1);
  options.keep_start = true;
  const ImportedScene kept =
      MustLoad(Leg("-1 1", R"(<keyframe><key name="k" qpos=".2 -3" qvel="1 0"/></keyframe>)"), options);
  EXPECT_EQ(StartOf(kept).mechanisms[0].q[1], -3);
  EXPECT_TRUE(
      HasNote(kept.report, Kind::kChanged, "joint 'knee': starts outside its limits, as the file has it"));
  // What the digits of a limit leave, 1e-9 rad, is not outside.
  EXPECT_EQ(MustLoad(Leg("5e-10 1")).initial_keyframe, -1);
  EXPECT_EQ(StartOf(MustLoad(Leg("2e-9 1"))).mechanisms[0].q[1], 2e-9);
}

// Two hinges, the second up to 0.1 rad, and a tendon a + 2 b.
std::string TwoHinges(const std::string& range, const std::string& equality = "") {
  return R"(<mujoco><compiler angle="radian"/><worldbody><body><joint name="a" axis="0 1 0"/><geom size=".1"/>
    <body pos=".5 0 0"><joint name="b" axis="0 1 0" range="-1 .1"/><geom size=".1"/></body></body></worldbody>
    <tendon><fixed name="sum" limited="true" range=")" +
         range + R"("><joint joint="a" coef="1"/><joint joint="b" coef="2"/></fixed></tendon>)" + equality +
         "</mujoco>";
}

TEST(ImportStart, FixedTendonsStartInsideTheirLimits) {
  // The least joint displacements: in the ratio of the coefficients, and a alone where b is at its limit.
  const ImportedScene near = MustLoad(TwoHinges(".2 1"));
  EXPECT_NEAR(StartOf(near).mechanisms[0].q[0], 0.04, kRounding);
  EXPECT_NEAR(StartOf(near).mechanisms[0].q[1], 0.08, kRounding);
  EXPECT_TRUE(HasNote(near.report, Kind::kChanged, "tendon 'sum': the file starts it outside its limits"));
  const ImportedScene far = MustLoad(TwoHinges(".5 1"));
  EXPECT_NEAR(StartOf(far).mechanisms[0].q[0], 0.3, kRounding);
  EXPECT_NEAR(StartOf(far).mechanisms[0].q[1], 0.1, kRounding);
  ImportOptions options;
  options.joint_coordinates = {{"b", 0.05}};
  const ImportedScene asked = MustLoad(TwoHinges(".2 1"), options);
  EXPECT_NEAR(StartOf(asked).mechanisms[0].q[0], 0.1, kRounding);
  EXPECT_NEAR(StartOf(asked).mechanisms[0].q[1], 0.05, kRounding);
  EXPECT_EQ(MustLoad(TwoHinges("-1 1")).initial_keyframe, -1);
}

// One more tendon on the same joints: what would take it out of its limits is left to the simulation.
TEST(ImportStart, FixedTendonsTakeNoOtherOutOfItsLimits) {
  std::string text = TwoHinges(".2 1");
  const auto add = [&](const std::string& range) {
    std::string more = text;
    more.insert(more.find("</tendon>"), "<fixed name='other' limited='true' range='" + range +
                                            "'><joint joint='a' coef='1'/></fixed>");
    return MustLoad(more);
  };
  const char* const brought = "tendon 'sum': starts outside its limits: it is brought inside";
  EXPECT_FALSE(HasNote(add("-1 .05").report, Kind::kChanged, brought));
  const ImportedScene loaded = add("-1 .03");  // a would start at 0.04
  EXPECT_TRUE(HasNote(loaded.report, Kind::kChanged, brought));
  EXPECT_EQ(loaded.initial_keyframe, -1);
}

TEST(ImportStart, WhatIsAskedForIsKeptOutsideLimitsByOption) {
  ImportOptions options;
  options.joint_coordinates = {{"b", 0.4}};
  EXPECT_NEAR(StartOf(MustLoad(TwoHinges("-1 1"), options)).mechanisms[0].q[1], 0.1, kRounding);
  options.keep_start = true;
  EXPECT_NEAR(StartOf(MustLoad(TwoHinges("-1 1"), options)).mechanisms[0].q[1], 0.4, kRounding);
}

TEST(ImportStart, FixedTendonsThatNoJointBringsInsideAreNamed) {
  const char* const brought = "tendon 'sum': starts outside its limits: it is brought inside";
  ImportOptions options;
  options.keep_start = true;
  const ImportedScene kept = MustLoad(TwoHinges(".2 1"), options);
  EXPECT_EQ(kept.initial_keyframe, -1);
  EXPECT_TRUE(HasNote(kept.report, Kind::kChanged, brought));
  // Both joints are asked for.
  options = {};
  options.joint_coordinates = {{"a", 0}, {"b", 0.05}};
  EXPECT_TRUE(HasNote(MustLoad(TwoHinges(".2 1"), options).report, Kind::kChanged, brought));
}

}  // namespace
}  // namespace fork1s::testing_importer
