// URDF: what MuJoCo's reader merges, forgets or stumbles over.
#include "helpers.hpp"
#include "mesh_writers.hpp"
#include "urdf_text.hpp"

namespace fork1s::testing_importer {
namespace {

TEST(ImportUrdf, RootKeepsItsMassAndFixedLinksStay) {
  const ImportedScene loaded =
      MustLoad(Robot(Link("base") + Link("arm") + Link("tip") +
                     Joint("j", "revolute", "base", "arm",
                           R"(<axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="1" velocity="1"/>
                                                       <dynamics damping=".3" friction=".1"/><origin xyz="0 0 1" rpy="0 0 .4"/>)") +
                     Joint("f", "fixed", "arm", "tip", "")));
  EXPECT_EQ(loaded.report.format, "URDF");
  const MechanismDef& robot = loaded.scene.mechanisms[0];
  ASSERT_EQ(robot.bodies.size(), 3u);
  EXPECT_EQ(robot.bodies[0].name, "base");
  EXPECT_EQ(robot.base, BaseKind::kFixed);
  const Matrix3 R = (Eigen::AngleAxisd(.5, Vector3::UnitZ()) * Eigen::AngleAxisd(-.2, Vector3::UnitY()) *
                     Eigen::AngleAxisd(.3, Vector3::UnitX()))
                        .toRotationMatrix();
  Matrix3 I;
  I << .03, .001, .002, .001, .04, -.003, .002, -.003, .05;
  for (const BodyDef& body : robot.bodies) {
    EXPECT_NEAR(body.inertia.mass, 2, 1e-12);
    EXPECT_LT((body.inertia.center - Vector3(.1, 0, 0)).norm(), 1e-12);
    EXPECT_LT((body.inertia.rotational - R * I * R.transpose()).norm(), 1e-9);
  }
  ASSERT_EQ(robot.joints.size(), 1u);
  EXPECT_EQ(robot.joints[0].freedoms[0].lower, -1);
  EXPECT_EQ(robot.joints[0].freedoms[0].damping, .3);
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChosen, "base floating"));
  EXPECT_EQ(robot.frictions.size(), 1u);
}

TEST(ImportUrdf, FloatingBase) {
  ImportOptions options;
  options.base = BaseKind::kFloating;
  const std::string text = Robot(Link("base") + Link("arm") + Joint("j", "continuous", "base", "arm", ""));
  const ImportedScene loaded = MustLoad(text, options);
  const MechanismDef& robot = loaded.scene.mechanisms[0];
  EXPECT_EQ(robot.base, BaseKind::kFloating);
  EXPECT_EQ(robot.bodies[0].name, "base");
  EXPECT_EQ(robot.bodies.size(), 2u);
  EXPECT_LT((robot.joints[0].freedoms[0].screw_B.head<3>() - Vector3::UnitX()).norm(),
            1e-12);  // URDF's default
  const std::string with_world =
      Robot("<link name=\"world\"/>" + Link("base") + Link("arm") + Joint("w", "fixed", "world", "base", "") +
            Joint("j", "continuous", "base", "arm", ""));
  EXPECT_EQ(MustLoad(with_world, options).scene.mechanisms[0].base, BaseKind::kFloating);
  const MechanismDef fixed = MustLoad(with_world).scene.mechanisms[0];
  EXPECT_EQ(fixed.base, BaseKind::kFixed);
  EXPECT_EQ(fixed.bodies[0].name, "base");
}

TEST(ImportUrdf, PlanarAndPrismaticJoints) {
  const ImportedScene loaded = MustLoad(Robot(Link("base") + Link("a") + Link("b") +
                                              Joint("p", "planar", "base", "a", "<axis xyz=\"0 0 1\"/>") +
                                              Joint("s", "prismatic", "a", "b")));
  int freedoms = 0;
  for (const JointDef& joint : loaded.scene.mechanisms[0].joints)
    freedoms += static_cast<int>(joint.freedoms.size());
  EXPECT_EQ(freedoms, 4);
  MustBuild(loaded.scene.mechanisms[0]);
}

TEST(ImportUrdf, UnexpandedXacro_IsNamedWithTheLineOfTheFile) {
  for (const std::string& part :
       {std::string("<xacro:property name=\"r\" value=\"2\"/>\n"),
        Link("rod", "<inertial><origin xyz=\"${r} 0 0\"/><mass value=\"1\"/></inertial>")}) {
    const Error error = MustFail(Robot(Link("base", "") + part + Joint("j", "fixed", "base", "base")));
    EXPECT_EQ(error.code, ErrorCode::kModel);
    EXPECT_CONTAINS(error.where, "test.xml, line 3");
    EXPECT_CONTAINS(error.message, "unexpanded xacro");
    EXPECT_CONTAINS(error.message, "xacro test.xml >");
  }
  const Error word = MustFail(Robot(Link("base", "") + "\n" + Link("a") + "\n\n" +
                                    Joint("j", "continuous", "base", "a", "<origin xyz=\"0 0 1m\"/>")));
  EXPECT_CONTAINS(word.where, "test.xml, line 8");
  EXPECT_CONTAINS(word.message, "xyz=\"0 0 1m\"");
}

TEST(ImportUrdf, SubstitutionsOfXacro_AreNamedAsUnexpanded) {
  for (const char* name : {"$(find pkg)/x.obj", "$(arg mesh).stl"})
    EXPECT_CONTAINS(MustFail(Arm(kInertial + MeshPart("collision", name))).message,
                    fmt::format("<mesh filename=\"{}\"> is unexpanded xacro", name));
}

TEST(ImportUrdf, NegativeLimitsOfEffortAndVelocity_AreNoneAndNoted) {
  const ImportedScene loaded =
      MustLoad(Robot(Link("base") + Link("a") +
                     Joint("j", "revolute", "base", "a",
                           "<limit lower=\"-1\" upper=\"1\" effort=\"-1\" velocity=\"-2\"/>")));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "joint 'j': its effort of -1 is below 0"));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "joint 'j': its velocity of -2 is below 0"));
  EXPECT_TRUE(loaded.report.velocity_limits.empty());
}

TEST(ImportUrdf, FloatingJointBelowALink_HasSixFreedoms) {
  const std::string at = "<origin xyz=\".2 0 1\" rpy=\".3 .2 .1\"/>";
  const ImportedScene loaded =
      MustLoad(Robot(Link("base") + Link("a") + Link("b") + Joint("j", "continuous", "base", "a") +
                     Joint("f", "floating", "a", "b", at)));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChanged, "joint 'f': floats below link 'a'"));
  const MechanismDef& robot = loaded.scene.mechanisms.at(0);
  ASSERT_EQ(robot.joints.size(), 5u);
  EXPECT_EQ(robot.joints[1].name, "f.x");
  EXPECT_EQ(robot.joints[4].name, "f.rotation");
  EXPECT_EQ(robot.joints[4].kind, JointKind::kBall);
  const Mechanism mechanism = MustBuild(robot);
  ASSERT_EQ(mechanism.num_coordinates(), 7);
  VectorX q = VectorX::Zero(7);
  const auto pose = [&] {
    Kinematics kinematics(mechanism);
    ComputeKinematics(mechanism, q, kinematics);
    return kinematics.X_RB[mechanism.FindBody("b").u()];
  };
  const RigidTransform before = pose();
  EXPECT_NEAR((before.translation() - Vector3(.2, 0, 1)).norm(), 0, 1e-15);
  q.tail<6>() << .01, .02, .03, .4, .5, .6;
  const RigidTransform moved = before.inverse() * pose();
  EXPECT_NEAR((moved.translation() - Vector3(.01, .02, .03)).norm(), 0, 1e-14);
  EXPECT_NEAR(Eigen::AngleAxisd(moved.rotation()).angle(), Vector3(.4, .5, .6).norm(), 1e-12);
}

TEST(ImportUrdf, ReversedLimits_AreNoneAndNoted) {
  const ImportedScene loaded =
      MustLoad(Robot(Link("base") + Link("a") +
                     Joint("j", "revolute", "base", "a",
                           "<limit lower=\".8\" upper=\"-.3\" effort=\"1\" velocity=\"1\"/>")));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "joint 'j': its lower limit 0.8"));
  EXPECT_TRUE(std::isinf(loaded.scene.mechanisms[0].joints[0].freedoms[0].upper));
}

TEST(ImportUrdf, OptionsOfTheMujocoBlockCount) {
  const std::string block =
      R"(<mujoco><compiler meshdir="elsewhere"/><option gravity="0 .5 -1.6"/></mujoco>)";
  const ImportedScene loaded =
      MustLoad(Robot(block + Link("base") + Link("a") + Joint("j", "continuous", "base", "a")));
  EXPECT_EQ(loaded.scene.gravity, Vector3(0, .5, -1.6));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "<compiler> in <mujoco>"));
}

TEST(ImportUrdf, WorldWithoutALink_IsTheStillWorld) {
  const std::string text = Robot(Link("base") + Link("arm") + Joint("w", "fixed", "world", "base", "") +
                                 Joint("j", "continuous", "base", "arm"));
  const ImportedScene fixed = MustLoad(text);
  EXPECT_EQ(fixed.scene.mechanisms[0].base, BaseKind::kFixed);
  EXPECT_EQ(fixed.scene.mechanisms[0].bodies[0].name, "base");
  ImportOptions options;
  options.base = BaseKind::kFloating;
  EXPECT_EQ(MustLoad(text, options).scene.mechanisms[0].base, BaseKind::kFloating);
}

// The effort of a joint bounds the PD control that holds it. Gains of a named joint replace the general ones.
TEST(ImportUrdf, EffortBoundsPdControl) {
  const auto joint = [](const std::string& name, const std::string& parent, const std::string& child,
                        const std::string& effort) {
    return Joint(
        name, "revolute", parent, child,
        "<axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" velocity=\"1\" effort=\"" + effort + "\"/>");
  };
  ImportOptions options;
  options.pd = PdGains{200, 5};
  options.joint_pd["k"] = {50, 1};
  const ImportedScene loaded = MustLoad(Robot(Link("base") + Link("a") + Link("b") +
                                              joint("j", "base", "a", "7.5") + joint("k", "a", "b", "3")),
                                        options);
  const auto& limits = loaded.scene.mechanisms[0].force_limits;
  ASSERT_EQ(limits.size(), 2u);
  EXPECT_EQ(limits[0].upper, 7.5);
  EXPECT_EQ(limits[0].lower, -7.5);
  EXPECT_EQ(limits[0].stiffness, 200);
  EXPECT_EQ(limits[1].upper, 3);
  EXPECT_EQ(limits[1].stiffness, 50);
  EXPECT_EQ(limits[1].damping, 1);
  ASSERT_EQ(limits[1].inputs.size(), 1u);
  EXPECT_EQ(limits[1].inputs[0].first, "k");
}

TEST(ImportUrdf, UnknownJointTypeDoesNotCrash) {
  const Error error = MustFail(Robot(Link("base") + Link("a") + Joint("ball", "spherical", "base", "a")));
  EXPECT_EQ(error.code, ErrorCode::kFormat);
  EXPECT_CONTAINS(error.where, "line 6");
  EXPECT_CONTAINS(error.message, "'spherical'");
  EXPECT_CONTAINS(error.message, "three revolute joints");
}

TEST(ImportUrdf, MimicIsACoupling) {
  const std::string text =
      Robot(Link("base") + Link("a") + Link("b") + Joint("ja", "continuous", "base", "a") +
            Joint("jb", "continuous", "a", "b",
                  R"(<axis xyz="0 1 0"/><mimic joint="ja" multiplier="-1.5" offset=".2"/>)"));
  const ImportedScene loaded = MustLoad(text);
  ASSERT_EQ(loaded.scene.mechanisms[0].couplings.size(), 1u);
  const CouplingDef& coupling = loaded.scene.mechanisms[0].couplings[0];
  EXPECT_EQ(coupling.polynomial[0], .2);
  EXPECT_EQ(coupling.polynomial[1], -1.5);
  EXPECT_EQ(coupling.a.joint, loaded.scene.mechanisms[0].FindJoint("jb"));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChanged, "'jb'"));
  std::string wrong = text;
  wrong.replace(wrong.find("joint=\"ja\""), 10, "joint=\"jx\"");
  EXPECT_CONTAINS(MustFail(wrong).message, "'jx'");
}

TEST(ImportUrdf, MeshesOfOneNameInTwoFoldersStayTwo) {
  WriteFile("left/part.stl", BinaryStl(CornerTetrahedron(.1, .1, .1)));
  WriteFile("right/part.stl", BinaryStl(CornerTetrahedron(.2, .2, .2)));
  const auto collision = [](const std::string& file) {
    return std::string(kInertial) + "<collision><geometry><mesh filename=\"" + file +
           "\"/></geometry></collision>";
  };
  const std::string path =
      WriteFile("urdf/robot.urdf",
                Robot(Link("base", collision("package://my_robot/left/part.stl")) +
                      Link("a", collision("../right/part.stl")) + Joint("j", "continuous", "base", "a")));
  const auto loaded = LoadMechanism(path);
  ASSERT_TRUE(loaded) << loaded.error().Text();
  const auto& bodies = loaded->scene.mechanisms[0].bodies;
  const auto& left = *std::get<MeshShape>(bodies[0].geometries.at(0).shape).mesh;
  const auto& right = *std::get<MeshShape>(bodies[1].geometries.at(0).shape).mesh;
  const auto size = [](const TriangleMesh& mesh) {
    float most = 0;
    for (const auto& a : mesh.vertices) {
      for (const auto& b : mesh.vertices) most = std::max(most, (a - b).norm());
    }
    return most;
  };
  EXPECT_NEAR(size(left), .1 * std::sqrt(2.0), 1e-6);
  EXPECT_NEAR(size(right), .2 * std::sqrt(2.0), 1e-6);
}

TEST(ImportUrdf, MissingMeshes) {
  const auto with = [](const std::string& kind, const std::string& file) {
    return Robot(Link("base", std::string(kInertial) + "<" + kind + "><geometry><mesh filename=\"" + file +
                                  "\"/></geometry></" + kind + ">") +
                 Link("a") + Joint("j", "continuous", "base", "a"));
  };
  const ImportedScene loaded = MustLoad(with("visual", "package://x/body.dae"));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "body.dae"));
  EXPECT_TRUE(loaded.scene.mechanisms[0].bodies[0].geometries.empty());
  EXPECT_TRUE(HasNote(MustLoad(with("visual", "gone.stl")).report, ImportNote::Kind::kDropped, "gone.stl"));
  const Error missing = MustFail(with("collision", "package://x/gone.stl"));
  EXPECT_EQ(missing.code, ErrorCode::kModel);
  EXPECT_CONTAINS(missing.Text(), "line 3");
  EXPECT_CONTAINS(missing.message, "link 'base'");
  EXPECT_CONTAINS(missing.message, "gone.stl");
  EXPECT_CONTAINS(MustFail(with("collision", "body.3ds")).message, "convert it to STL");
}

TEST(ImportUrdf, MaterialsAndColours) {
  const std::string visual = R"(<visual name="v"><geometry><box size=".1 .1 .1"/></geometry>)";
  const ImportedScene loaded = MustLoad(Robot(
      R"(<material name="blue"><color rgba="0 0 1 1"/></material>)" +
      Link(
          "base",
          kInertial + visual + R"(<material name="blue"/></visual>)" + visual +
              R"(<material name="m"><color rgba="1 0 0 1"/></material><material name="n"><color rgba="0 1 0 1"/></material></visual>)") +
      Link("a", kInertial + visual + R"(<material name="m"><color rgba="0 1 1 1"/></material></visual>)") +
      Joint("j", "continuous", "base", "a")));
  const auto& bodies = loaded.scene.mechanisms[0].bodies;
  EXPECT_EQ(bodies[0].geometries.at(0).rgba, Vector4(0, 0, 1, 1));
  EXPECT_EQ(bodies[0].geometries.at(1).rgba, Vector4(1, 0, 0, 1));
  EXPECT_EQ(bodies[1].geometries.at(0).rgba, Vector4(0, 1, 1, 1));
  EXPECT_FALSE(bodies[0].geometries[0].Collides());
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "further <material>"));
}

TEST(ImportUrdf, InertiaIsRepairedOrRefused) {
  const auto inertial = [](const std::string& mass, const std::string& xx, const std::string& yy,
                           const std::string& zz) {
    return R"(<inertial><mass value=")" + mass + R"("/><inertia ixx=")" + xx + R"(" ixy="0" ixz="0" iyy=")" +
           yy + R"(" iyz="0" izz=")" + zz + R"("/></inertial>)";
  };
  const auto robot = [&](const std::string& tip) {
    return Robot(Link("base") + Link("a") + Link("tip", tip) + Joint("j", "continuous", "base", "a") +
                 Joint("t", "fixed", "a", "tip", ""));
  };
  ImportedScene loaded = MustLoad(robot(inertial("1", ".1", ".1", ".4")));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChanged, "link 'tip'"));
  EXPECT_LT((loaded.scene.mechanisms[0].bodies[2].inertia.rotational - .2 * Matrix3::Identity()).norm(),
            1e-12);
  loaded = MustLoad(robot(inertial("0", "0", "0", "0")));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "zero mass"));
  EXPECT_EQ(loaded.scene.mechanisms[0].bodies[2].inertia.mass, 0);
  EXPECT_EQ(loaded.scene.mechanisms[0].bodies[2].inertia.rotational, Matrix3::Zero());
  const Error error = MustFail(robot(inertial("1", ".1", "-.1", ".1")));
  EXPECT_CONTAINS(error.message, "'tip'");
  EXPECT_CONTAINS(error.message, "negative principal moment");
  EXPECT_CONTAINS(MustFail(robot(inertial("-1", ".1", ".1", ".1"))).message, "negative mass");
  EXPECT_CONTAINS(MustFail(robot(inertial("nan", ".1", ".1", ".1"))).message, "nan");
}

TEST(ImportUrdf, CapsuleBecomesTheSameSolid) {
  const ImportedScene loaded =
      MustLoad(Robot(Link("base") +
                     Link("a", std::string(kInertial) +
                                   R"(<collision><origin xyz="0 0 1" rpy="1.5707963267948966 0 0"/>
                                      <geometry><capsule radius=".1" length=".6"/></geometry></collision>)") +
                     Joint("j", "continuous", "base", "a")));
  const auto& shapes = loaded.scene.mechanisms[0].bodies[1].geometries;
  ASSERT_EQ(shapes.size(), 3u);
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChanged, "capsule"));
  double y = 0;
  for (const auto& shape : shapes) y = std::max(y, shape.X_BG.translation().y());
  EXPECT_NEAR(y, .3, 1e-9);
}

TEST(ImportUrdf, CapsuleOfDrakeIsACapsule) {
  const auto shapes = [](const char* kind) {
    return MustLoad(Arm(kInertial + Part("collision", fmt::format("<{} xmlns:drake=\"http://drake.mit.edu\" "
                                                                  "radius=\".1\" length=\".6\"/>",
                                                                  kind))))
        .scene.mechanisms[0]
        .bodies[1]
        .geometries.size();
  };
  EXPECT_EQ(shapes("capsule"), 3u);
  EXPECT_EQ(shapes("drake:capsule"), 3u);
}

TEST(ImportUrdf, LateDeclarationIsSkipped) {
  const ImportedScene loaded =
      MustLoad("<!-- made by hand -->\n<?xml version=\"1.0\"?>\n" +
               Robot(Link("base") + Link("a") + Joint("j", "continuous", "base", "a")));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChanged, "line 2"));
}

TEST(ImportUrdf, LongChainsAreNotNested) {
  const auto named = [](const char* prefix, int i) {
    std::string name = prefix;
    name += std::to_string(i);
    return name;
  };
  std::string content = Link("l0");
  for (int i = 1; i <= 150; ++i) {
    content += Link(named("l", i));
    content += Joint(named("j", i), "continuous", named("l", i - 1), named("l", i));
  }
  EXPECT_EQ(MustLoad(Robot(content)).scene.mechanisms[0].joints.size(), 150u);
}

TEST(ImportUrdf, BrokenTrees) {
  const std::string two = Link("base") + Link("a");
  EXPECT_CONTAINS(MustFail(Robot(two)).message, "2 links have no parent");
  EXPECT_CONTAINS(MustFail(Robot(two + Joint("j", "fixed", "base", "b"))).message, "'b'");
  EXPECT_CONTAINS(
      MustFail(Robot(two + Joint("j", "fixed", "base", "a") + Joint("k", "fixed", "base", "a"))).message,
      "two joints");
  EXPECT_CONTAINS(
      MustFail(Robot(two + Joint("j", "fixed", "base", "a") + Joint("k", "fixed", "a", "base"))).message,
      "circle");
  EXPECT_CONTAINS(MustFail(Robot(Link("base") + two)).message, "two links 'base'");
  EXPECT_CONTAINS(MustFail(Robot("")).message, "no link");
  EXPECT_CONTAINS(MustFail(Robot(two + Joint("j", "fixed", "base", "a"))).message,
                  "nothing in the file can move");
}

TEST(ImportUrdf, ElementsOfLinksAndJointsThatNothingReads_AreNoted) {
  const auto loaded = LoadMechanism(WriteFile(
      "arm.urdf",
      Robot(Link("foot") +
            Link("upper", std::string(kInertial) +
                              "<collision><geometry><box size='.1 .1 .1'/></geometry><contact_coefficients "
                              "mu='.3'/></collision><contact><lateral_friction value='.2'/></contact>") +
            Joint("knee", "continuous", "foot", "upper",
                  "<axis xyz='0 1 0'/><calibration rising='0'/><safety_controller k_velocity='10'/>"))));
  ASSERT_TRUE(loaded) << loaded.error().Text();
  for (const char* element : {"1 <contact_coefficients> in <collision>", "1 <contact> in <link>",
                              "1 <safety_controller> in <joint>"})
    EXPECT_TRUE(HasNote(loaded->report, ImportNote::Kind::kDropped, element)) << element;
  EXPECT_FALSE(HasNote(loaded->report, ImportNote::Kind::kDropped, "calibration"));
}

TEST(UrdfMimic, OfOrByFixedJointsIsNoted) {
  const auto load = [](const std::string& leader, const std::string& follower) {
    return MustLoad(Robot(
        Link("base") + Link("a") + Link("b") + Link("d") + Joint("ja", leader, "base", "a") +
        Joint("jb", follower, "base", "b", R"(<axis xyz="0 1 0"/><mimic joint="ja" multiplier="-1"/>)") +
        Joint("jd", "continuous", "base", "d")));
  };
  const ImportedScene of_fixed = load("fixed", "continuous"), by_fixed = load("continuous", "fixed");
  EXPECT_TRUE(of_fixed.scene.mechanisms[0].couplings.empty());
  EXPECT_TRUE(HasNote(of_fixed.report, ImportNote::Kind::kDropped, "joint 'jb': joint 'ja' is fixed"));
  EXPECT_TRUE(by_fixed.scene.mechanisms[0].couplings.empty());
  EXPECT_TRUE(HasNote(by_fixed.report, ImportNote::Kind::kDropped, "joint 'jb': it is fixed"));
}

TEST(UrdfMimic, LimitsOfTheLeaderAct) {
  const auto load = [](const std::string& upper) {
    return MustLoad(
        Robot(Link("base") + Link("a") + Link("b") +
              Joint("ja", "revolute", "base", "a",
                    R"(<axis xyz="0 1 0"/><limit lower="0" upper=".8" effort="1" velocity="1"/>)") +
              Joint("jb", "revolute", "a", "b",
                    R"(<axis xyz="0 1 0"/><mimic joint="ja" multiplier="-1"/><limit lower="-)" + upper +
                        R"(" upper=".1" effort="1" velocity="1"/>)")));
  };
  // From 0.001 rad beyond on it is said.
  for (const char* upper : {".5", ".7985", ".7995", ".9"}) {
    const ImportedScene loaded = load(upper);
    const auto& joints = loaded.scene.mechanisms[0].joints;
    EXPECT_EQ(joints[0].freedoms[0].upper, 0.8);
    EXPECT_TRUE(std::isinf(joints[1].freedoms[0].lower));
    EXPECT_EQ(HasNote(loaded.report, ImportNote::Kind::kChanged, "joint 'jb': its own limits do not act"),
              std::stod(upper) < .799)
        << upper;
  }
}

}  // namespace
}  // namespace fork1s::testing_importer
