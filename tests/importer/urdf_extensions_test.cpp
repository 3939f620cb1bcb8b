// <gazebo>, <loop_joint> and constraints of Drake in a URDF.
#include "importer/mjcf.hpp"

#include "helpers.hpp"
#include "urdf_text.hpp"

namespace fork1s::testing_importer {
namespace {

std::string Arms(const std::string& more) {
  return Robot(
      Link("base") + Link("a") + Link("b") +
      Joint("j", "continuous", "base", "a", "<axis xyz=\"0 1 0\"/><dynamics damping=\"4\" friction=\"5\"/>") +
      Joint("k", "prismatic", "a", "b",
            "<axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/>") +
      more);
}

std::string Gazebo(const std::string& reference, const std::string& content) {
  return "<gazebo reference=\"" + reference + "\">" + content + "</gazebo>";
}

TEST(UrdfExtensions, GazeboGivesAJointItsSpringDamperAndFriction) {
  const ImportedScene loaded = MustLoad(
      Arms(Gazebo("j",
                  "<implicitSpringDamper>1</implicitSpringDamper><springStiffness> 250 </springStiffness>"
                  "<springReference>.3</springReference>") +
           Gazebo("k", "<springStiffness>80</springStiffness><damping>7</damping><friction>2</friction>") +
           Gazebo("k", "<provideFeedback>true</provideFeedback>") + Gazebo("base", "<kp>1</kp><kd>2</kd>")));
  const MechanismDef& robot = loaded.scene.mechanisms[0];
  const FreedomDef &j = robot.joints[robot.FindJoint("j").u()].freedoms[0],
                   &k = robot.joints[robot.FindJoint("k").u()].freedoms[0];
  EXPECT_EQ(j.stiffness, 250);
  EXPECT_DOUBLE_EQ(j.rest, .3);
  EXPECT_EQ(j.damping, 4);
  EXPECT_EQ(k.stiffness, 80);
  EXPECT_EQ(k.rest, 0);
  EXPECT_EQ(k.damping, 7);
  ASSERT_EQ(robot.frictions.size(), 2u);
  EXPECT_EQ(robot.frictions[0].force, 5);
  EXPECT_EQ(robot.frictions[1].force, 2);
  for (const char* unread : {"1 <provideFeedback> in <gazebo>", "1 <kp> in <gazebo>", "1 <kd> in <gazebo>"})
    EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, unread)) << unread;
  EXPECT_FALSE(HasNote(loaded.report, ImportNote::Kind::kDropped, "implicitSpringDamper"));
}

TEST(UrdfExtensions, GravityOfALink_IsSwitchedOff) {
  for (const char* off : {"<gravity>false</gravity>", "<turnGravityOff>true</turnGravityOff>"}) {
    const ImportedScene loaded = MustLoad(Arms(Gazebo("a", off) + Gazebo("b", "<gravity>1</gravity>")));
    const MechanismDef& robot = loaded.scene.mechanisms[0];
    EXPECT_EQ(robot.bodies[robot.FindBody("a").u()].gravity_compensation, 1) << off;
    EXPECT_EQ(robot.bodies[robot.FindBody("b").u()].gravity_compensation, 0) << off;
    EXPECT_FALSE(HasNote(loaded.report, ImportNote::Kind::kDropped, "ravity")) << off;
  }
  EXPECT_TRUE(HasNote(MustLoad(Arms(Gazebo("aa", "<gravity>0</gravity>"))).report, ImportNote::Kind::kDropped,
                      "<gazebo> of link 'aa': no link has that name"));
  EXPECT_CONTAINS(MustFail(Arms(Gazebo("a", "<gravity>off</gravity>"))).message, "write true or false");
}

std::string Ros2Control(const std::string& joint, const std::string& value,
                        const std::string& interface = "position") {
  return "<ros2_control name=\"c\" type=\"system\"><joint name=\"" + joint + "\"><state_interface name=\"" +
         interface + "\"><param name=\"initial_value\">" + value +
         "</param></state_interface></joint></ros2_control>";
}

TEST(UrdfExtensions, InitialValueOfRos2Control_IsWhereAJointStarts) {
  const auto start = [](const std::string& text, const ImportOptions& options = {}) {
    const ImportedScene loaded = MustLoad(Arms(text), options);
    EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "1 <ros2_control>: it is not modelled;"));
    if (loaded.scene.keyframes.empty()) return std::pair(0.0, 0.0);
    const VectorX& q = loaded.scene.keyframes.at(0).mechanisms.at(0).q;
    return std::pair(q[0], q[1]);
  };
  EXPECT_EQ(start(Ros2Control("j", ".4")), std::pair(.4, 0.));
  EXPECT_EQ(start(Ros2Control("k", "-.2")), std::pair(0., -.2));
  EXPECT_EQ(start(Ros2Control("j", ".4", "velocity")), std::pair(0., 0.));
  EXPECT_EQ(start(Ros2Control("j", "0")), std::pair(0., 0.));
  ImportOptions options;
  options.joint_coordinates["j"] = -.5;
  EXPECT_EQ(start(Ros2Control("j", ".4"), options), std::pair(-.5, 0.));
  EXPECT_TRUE(HasNote(MustLoad(Arms(Ros2Control("jj", "1"))).report, ImportNote::Kind::kDropped,
                      "initial_value of joint 'jj': no joint has that name"));
  EXPECT_TRUE(HasNote(MustLoad(Arms(Ros2Control("k", "3"))).report, ImportNote::Kind::kChosen,
                      "initial_value of joint 'k': 3 m is outside its limits"));
  EXPECT_CONTAINS(MustFail(Arms(Ros2Control("j", "half"))).message, "'half', which is no finite number");
}

TEST(UrdfExtensions, WhatIsNotModelled_IsToldFromWhatHasNoMeaning) {
  const ImportedScene loaded = MustLoad(Arms(
      Gazebo("a", "<material>Gazebo/Red</material><sensor name=\"s\"/>") +
      "<gazebo><static>true</static></gazebo><material name=\"m\"><texture filename=\"a.png\"/></material>"
      "<transmission name=\"t\"/>"));
  for (const char* note :
       {"1 <material> in <gazebo>: it has no meaning here",
        "1 <texture> in <material>: it has no meaning here", "1 <sensor> in <gazebo>: it is not modelled",
        "1 <transmission>: it is not modelled"})
    EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, note)) << note;
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChanged, "<static> in <gazebo>: its base is fixed"));
  EXPECT_FALSE(HasNote(loaded.report, ImportNote::Kind::kDropped, "static"));
}

TEST(UrdfExtensions, GazeboOfOtherThings_IsNotedOrRefused) {
  const std::string spring = "<springStiffness>9</springStiffness>";
  EXPECT_TRUE(HasNote(MustLoad(Arms(Gazebo("jj", spring))).report, ImportNote::Kind::kDropped,
                      "<gazebo> of joint 'jj': no joint has that name"));
  const ImportedScene planar =
      MustLoad(Robot(Link("base") + Link("a") + Joint("p", "planar", "base", "a") + Gazebo("p", spring)));
  EXPECT_TRUE(HasNote(planar.report, ImportNote::Kind::kDropped, "<gazebo> of joint 'p': a planar joint"));
  const Error word = MustFail(Arms("\n" + Gazebo("j", "<springStiffness>9 N</springStiffness>")));
  EXPECT_CONTAINS(word.where, "test.xml, line 11");
  EXPECT_CONTAINS(word.message, "<springStiffness> holds '9 N', which is no finite number");
  for (const char* number : {"1e999", "nan", "", "1 2"})
    EXPECT_CONTAINS(
        MustFail(Arms(Gazebo("j", std::string("<springReference>") + number + "</springReference>"))).message,
        "which is no finite number");
  EXPECT_CONTAINS(MustFail(Arms(Gazebo("j", "<damping>-1</damping>"))).message, "'j' is -1");
  EXPECT_CONTAINS(MustFail(Arms(Gazebo("a", "<selfCollide>no</selfCollide>"))).message,
                  "<selfCollide> holds 'no'; write true or false");
}

TEST(UrdfExtensions, FrictionOfALink_ActsOnWhateverItTouches) {
  const std::string ball = kInertial + Part("collision", "<sphere radius=\".01\"/>");
  const ImportedScene loaded =
      MustLoad(Robot(Link("base", ball) + Link("a", ball) + Joint("j", "continuous", "base", "a") +
                     Gazebo("a", "<mu1>.3</mu1><mu2>.2</mu2>")));
  const MechanismDef& robot = loaded.scene.mechanisms[0];
  const GeometryDef &plain = robot.bodies[0].geometries.at(0), &rubs = robot.bodies[1].geometries.at(0);
  EXPECT_EQ(rubs.friction, .3);
  EXPECT_GT(rubs.priority, plain.priority);
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChanged, "link 'a': friction is the same"));
}

TEST(UrdfExtensions, SelfCollide_KeepsALinkFromTouchingItsRobot) {
  const std::string ball =
      kInertial + Part("collision", "<sphere radius=\".01\"/>", "<origin xyz=\"0 0 .1\"/>");
  const auto robot = [&](const std::string& more) {
    return MustLoad(Robot(Link("base", ball) + Link("a", ball) + Link("b", ball) +
                          Joint("j", "continuous", "base", "a") + Joint("k", "continuous", "base", "b") +
                          more))
        .scene.excluded_pairs;
  };
  const auto has = [](const Pairs& pairs, const char* a, const char* b) {
    return std::count(pairs.begin(), pairs.end(), std::pair<std::string, std::string>(a, b)) > 0;
  };
  const Pairs open = robot(""), same = robot(Gazebo("a", "<selfCollide>true</selfCollide>"));
  EXPECT_FALSE(has(open, "a", "b"));
  EXPECT_EQ(open, same);
  EXPECT_TRUE(has(robot(Gazebo("a", "<selfCollide>false</selfCollide>")), "a", "b"));
  EXPECT_TRUE(has(robot("<gazebo><self_collide>false</self_collide></gazebo>"), "a", "b"));
  EXPECT_TRUE(has(
      robot("<gazebo><self_collide>0</self_collide></gazebo>" + Gazebo("b", "<selfCollide>1</selfCollide>")),
      "a", "b"));
}

// All links touch the world; of one robot the outermost and the base do, and those that are said to.
TEST(UrdfExtensions, SelfCollide_LetsInnerLinksTouchTheirRobot) {
  const std::string ball =
      kInertial + Part("collision", "<sphere radius=\".01\"/>", "<origin xyz=\"0 0 .1\"/>");
  const auto robot = [&](const std::string& more) {
    return MustLoad(Robot(Link("base", ball) + Link("a", ball) + Link("b", ball) + Link("c", ball) +
                          Joint("i", "continuous", "base", "a") + Joint("j", "continuous", "a", "b") +
                          Joint("k", "continuous", "b", "c") + more));
  };
  const ImportedScene silent = robot("");
  EXPECT_EQ(silent.scene.mechanisms[0].interfaces, (std::vector<std::string>{"a", "b", "c"}));
  EXPECT_TRUE(HasNote(silent.report, Kind::kChosen, "each other and the base are touched by 'c' and links"));
  const auto has = [](const ImportedScene& loaded, const char* a, const char* b) {
    const Pairs& pairs = loaded.scene.excluded_pairs;
    return std::count(pairs.begin(), pairs.end(), std::pair<std::string, std::string>(a, b)) > 0;
  };
  EXPECT_TRUE(has(silent, "a", "c"));
  EXPECT_TRUE(has(silent, "b", "base"));
  EXPECT_FALSE(has(silent, "c", "base"));
  const ImportedScene all = robot("<gazebo><self_collide>true</self_collide></gazebo>");
  EXPECT_TRUE(all.scene.excluded_pairs.empty());
  const ImportedScene two =
      robot(Gazebo("a", "<selfCollide>1</selfCollide>") + Gazebo("c", "<selfCollide>1</selfCollide>"));
  EXPECT_FALSE(has(two, "a", "c"));
  EXPECT_TRUE(has(two, "b", "base"));
  // A link stands for what is fixed to it.
  const ImportedScene welded =
      robot(Link("pad", ball) + Joint("w", "fixed", "a", "pad") +
            Gazebo("a", "<selfCollide>1</selfCollide>") + Gazebo("c", "<selfCollide>1</selfCollide>"));
  EXPECT_EQ(welded.scene.mechanisms[0].interfaces, (std::vector<std::string>{"b", "c", "pad"}));
  EXPECT_FALSE(has(welded, "c", "pad"));
  EXPECT_TRUE(has(welded, "b", "pad"));
  ImportOptions options;
  options.interfaces = {"a", "c"};
  EXPECT_FALSE(
      HasNote(MustLoad(Robot(Link("base", ball) + Link("a", ball) + Link("c", ball) +
                             Joint("i", "continuous", "base", "a") + Joint("k", "continuous", "a", "c")),
                       options)
                  .report,
              Kind::kChosen, "each other and the base"));
}

// A parallelogram of two cranks of .2 m and a coupler of .3 m; it stands in the plane whose normal is y.
std::string Parallelogram(const std::string& closure) {
  const auto at = [](const char* xyz) {
    return std::string("<axis xyz=\"0 1 0\"/><origin xyz=\"") + xyz + "\"/>";
  };
  return Robot(Link("base") + Link("a") + Link("b") + Link("c") +
               Joint("ja", "continuous", "base", "a", at("0 0 0")) +
               Joint("jb", "continuous", "a", "b", at("0 0 .2")) +
               Joint("jc", "continuous", "base", "c", at(".3 0 0")) + closure);
}

// With ja at q the coupler does not turn and c is parallel to a.
void ExpectParallel(const std::string& closure, double q) {
  ImportOptions options;
  options.joint_coordinates["ja"] = q;
  const ImportedScene loaded = MustLoad(Parallelogram(closure), options);
  const MechanismDef& robot = loaded.scene.mechanisms[0];
  ASSERT_EQ(robot.closures.size(), 1u);
  const VectorX& at =
      loaded.scene.keyframes[static_cast<std::size_t>(loaded.initial_keyframe)].mechanisms[0].q;
  const auto of = [&](const char* joint) {
    return at[static_cast<Eigen::Index>(robot.FindJoint(joint).u())];
  };
  EXPECT_NEAR(of("ja"), q, 1e-9);
  EXPECT_NEAR(of("jb"), -q, 1e-6);
  EXPECT_NEAR(of("jc"), q, 1e-6);
}

const char* const kHinge =
    "<loop_joint name=\"l\" type=\"continuous\"><link1 link=\"b\" xyz=\".3 0 0\" rpy=\"0 0 0\"/>"
    "<link2 link=\"c\" xyz=\"0 0 .2\" rpy=\"0 0 0\"/><axis xyz=\"0 1 0\"/></loop_joint>";

TEST(UrdfExtensions, LoopJointIsAHinge) {
  ExpectParallel(kHinge, .7);
  const MechanismDef robot = MustLoad(Parallelogram(kHinge)).scene.mechanisms[0];
  const ClosureDef& closure = robot.closures.at(0);
  EXPECT_EQ(closure.name, "l");
  EXPECT_EQ(closure.rigid.count(), 5);
  EXPECT_FALSE(closure.rigid[2]);
  EXPECT_LT((closure.X_AJ.rotation().col(2) - Vector3::UnitY()).norm(), 1e-12);
  EXPECT_LT((closure.X_AJ.translation() - Vector3(.3, 0, 0)).norm(), 1e-12);
  EXPECT_LT((closure.X_BJ.translation() - Vector3(0, 0, .2)).norm(), 1e-12);
}

TEST(UrdfExtensions, DrakeBallConstraintIsAPoint) {
  const auto ball = [](const std::string& points) {
    return "<drake:ball_constraint><drake:ball_constraint_body_A name=\"b\"/>"
           "<drake:ball_constraint_body_B name=\"c\"/>" +
           points + "</drake:ball_constraint>";
  };
  const std::string P = "<drake:ball_constraint_p_AP value=\".3 0 0\"/>";
  ExpectParallel(ball(P + "<drake:ball_constraint_p_BQ value=\"0 0 .2\"/>"), -.4);
  ExpectParallel(ball(P), -.4);
  EXPECT_CONTAINS(MustFail(Parallelogram(ball(""))).message, "needs three numbers");
}

TEST(UrdfExtensions, LoopToTheWorld_ClosesOnIt) {
  const std::string ball =
      "<drake:ball_constraint><drake:ball_constraint_body_A name=\"c\"/>"
      "<drake:ball_constraint_body_B name=\"world\"/><drake:ball_constraint_p_AP value=\"0 0 .2\"/>"
      "<drake:ball_constraint_p_BQ value=\".3 0 .2\"/></drake:ball_constraint>";
  const MechanismDef robot = MustLoad(Parallelogram(ball)).scene.mechanisms[0];
  ASSERT_EQ(robot.closures.size(), 1u);
  EXPECT_EQ(robot.closures[0].body_b, BodyIndex(0));
  EXPECT_LT((robot.closures[0].X_BJ.translation() - Vector3(.3, 0, .2)).norm(), 1e-12);
}

TEST(UrdfExtensions, LoopsThatCannotBeClosed_AreNotedOrRefused) {
  const ImportedScene loaded =
      MustLoad(Parallelogram("<loop_joint name=\"l\" type=\"prismatic\"/><drake:tendon_constraint/>"));
  EXPECT_TRUE(
      HasNote(loaded.report, ImportNote::Kind::kDropped, "<loop_joint> 'l': its type is 'prismatic'"));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "<drake:tendon_constraint>"));
  std::string unknown = kHinge;
  unknown.replace(unknown.find("\"c\""), 3, "\"cc\"");
  const Error error = MustFail(Parallelogram(unknown));
  EXPECT_EQ(error.code, ErrorCode::kModel);
  EXPECT_CONTAINS(error.where, "line");
  EXPECT_CONTAINS(error.message, "'cc', which is not in the file");
}

// MJCF has no hinge equality: two points on the axis stand for one, and the file means the same again.
TEST(UrdfExtensions, AreWrittenAsMjcf) {
  const std::string path =
      WriteFile("loop.urdf", Parallelogram(kHinge + Gazebo("ja",
                                                           "<springStiffness>3</springStiffness>"
                                                           "<springReference>.5</springReference>")));
  const auto written = ModelAsMjcf(path, {}, ".", "meshes");
  ASSERT_TRUE(written) << written.error().Text();
  const MechanismDef robot = MustLoad(written->text).scene.mechanisms[0];
  EXPECT_EQ(robot.closures.size(), 2u);
  EXPECT_EQ(robot.joints[robot.FindJoint("ja").u()].freedoms[0].stiffness, 3);
  EXPECT_DOUBLE_EQ(robot.joints[robot.FindJoint("ja").u()].freedoms[0].rest, .5);
  EXPECT_LT((robot.closures[1].X_AJ.translation() - robot.closures[0].X_AJ.translation())
                .normalized()
                .cross(Vector3::UnitY())
                .norm(),
            1e-12);
}

TEST(UrdfExtensions, LoopJointThatIsNamedAsSwitched_IsOneThatStartsOn) {
  ImportOptions options;
  options.switched = {"l"};
  const MechanismDef robot = MustLoad(Parallelogram(kHinge), options).scene.mechanisms.at(0);
  EXPECT_TRUE(robot.closures.empty());
  ASSERT_EQ(robot.switched_closures.size(), 1u);
  EXPECT_EQ(robot.switched_closures[0].rigid.count(), 5);
  EXPECT_FALSE(robot.switched_closures[0].rigid[2]);
  ASSERT_EQ(robot.controls.size(), 1u);
  EXPECT_EQ(robot.controls[0].name, "l");
  EXPECT_EQ(robot.controls[0].initial, 1);
  // In MJCF it would be two points, each with a control of its own.
  const auto refused = ModelAsMjcf(WriteFile("loop.urdf", Parallelogram(kHinge)), options, ".", "meshes");
  ASSERT_FALSE(refused);
  EXPECT_CONTAINS(refused.error().Text(), "loop joint 'l' is a hinge");
  // One without rotation is a weld.
  std::string fixed = kHinge;
  fixed.replace(fixed.find("continuous"), 10, "fixed");
  const auto written = ModelAsMjcf(WriteFile("loop.urdf", Parallelogram(fixed)), options, ".", "meshes");
  ASSERT_TRUE(written) << written.error().Text();
  const MechanismDef again = MustLoad(written->text).scene.mechanisms.at(0);
  EXPECT_TRUE(again.closures.empty());
  ASSERT_EQ(again.controls.size(), 1u);
  EXPECT_EQ(again.controls[0].initial, 1);
}

}  // namespace
}  // namespace fork1s::testing_importer
