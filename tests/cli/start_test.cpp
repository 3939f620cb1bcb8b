// Options that say where a model starts and where the files of a URDF lie, as a user types them.
#include <cmath>
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

// A trunk that floats when asked, over a foot on a knee; its ball of 0.05 m is the lowest point, 0.55 m down.
std::string HopperUrdf(const std::string& foot = R"(<sphere radius=".05"/>)") {
  const std::string inertial =
      R"(<inertial><mass value="1"/><inertia ixx=".01" ixy="0" ixz="0" iyy=".01" iyz="0"
    izz=".01"/></inertial>)";
  return R"(<robot name="hopper"><link name="trunk">)" + inertial + R"(</link><link name="foot">)" +
         inertial + "<collision><geometry>" + foot + R"(</geometry></collision></link>
  <joint name="knee" type="revolute"><parent link="trunk"/><child link="foot"/><origin xyz="0 0 -.5"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="1" velocity="1"/></joint></robot>)";
}

// A COLLADA tetrahedron with 200 mm legs, in millimetres.
std::string TetrahedronDae() {
  return R"(<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="millimeter" meter="0.001"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="12">0 0 0 200 0 0 0 200 0 0 0 200
</float_array><technique_common><accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="4">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry>
</library_geometries><library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>)";
}

double TrunkHeight(const nlohmann::json& run) {
  for (const auto& body : run["interface"])
    if (body["body"] == "foot") return body["position_m"][2].get<double>() + .5;
  throw std::runtime_error("no foot");
}

TEST(Start, FloatingRobotFallsOnlyWithoutGround) {
  const std::string model = Write("hopper.urdf", HopperUrdf());
  const std::string run = "run --json --time 1 --base floating --pd 500,20 ";
  const Outcome falls = Fork1s(run + model);
  ASSERT_EQ(falls.code, 0) << falls.err;
  EXPECT_NEAR(TrunkHeight(falls.Json()), -9.81 / 2,
              .1);  // a step of 1/60 s late at most: g dt t / 2 = 0.08 m
  EXPECT_NE(falls.out.find("nothing to fall on"), std::string::npos);
  const Outcome stands = Fork1s(run + "--ground " + model);
  ASSERT_EQ(stands.code, 0) << stands.err;
  EXPECT_GT(stands.Json()["contacts_max"].get<int>(), 0);
  EXPECT_NEAR(TrunkHeight(stands.Json()), 0, 1e-3);  // on its foot, balanced; the contact's slop is 0.1 mm
  // Dropped from 0.3 m above the plane, which then lies at zero.
  const Outcome drops = Fork1s(run + "--ground --base-pose 0,0,.85 " + model);
  ASSERT_EQ(drops.code, 0) << drops.err;
  EXPECT_NEAR(TrunkHeight(drops.Json()), .55, 2e-3);
  // A negative first number and a height behind the sign of equality.
  const Outcome high = Fork1s(run + "--ground=-1 --base-pose -1,0,-.45,0,0,3.1 " + model);
  ASSERT_EQ(high.code, 0) << high.err;
  EXPECT_NEAR(TrunkHeight(high.Json()), -.45, 2e-3);
}

TEST(Start, EveryCommandTakesTheOptions) {
  const std::string model = Write("hopper.urdf", HopperUrdf());
  const std::string start = " --base floating --ground --base-pose 0,0,1 --q knee=.5 --pd 50,2 " + model;
  for (const char* command : {"inspect", "reduce", "run --time .1", "compare --time .1"})
    EXPECT_EQ(Fork1s(command + start).code, 0) << command << Fork1s(command + start).err;
  EXPECT_EQ(Fork1s("statics --body foot --force 0,0,1 --q knee=.5 --pd 50,2 " + model).code, 0);
  // Options before the model take one word each.
  EXPECT_EQ(Fork1s("inspect --q knee=.5 --pd 50,2 " + model + " --json").code, 0);
  EXPECT_EQ(Fork1s("inspect --pd 50,2 " + model + " --json --modes 2").code, 0);
  EXPECT_EQ(Fork1s("inspect --interface foot " + model + " --json --modes 2").code, 0);
  // The coordinate reaches the pose: the foot turns about y, cos(q/2) in its quaternion.
  const auto run = Fork1s("run --json --time 0 --q knee=.5 --pd 50,2 " + model).Json();
  EXPECT_NEAR(run["interface"][0]["quaternion_wxyz"][0].get<double>(), std::cos(.25), 1e-12);
}

TEST(Start, BadValuesAreUsage) {
  const std::string model = Write("hopper.urdf", HopperUrdf()), finger = Write("finger.xml", FingerModel());
  const std::pair<std::string, std::string> bad[] = {
      {"--q kne=1 " + model, "near names are 'knee'"},
      {"--q knee " + model, "NAME=VALUE"},
      {"--q knee=x " + model, "'x' is not a finite number"},
      {"--q knee=inf " + model, "'inf' is not a finite number"},
      {"--base-pose 1,2 " + model, "takes 3 numbers"},
      {"--base-pose 1,2,3,4 " + model, "takes 6 numbers"},
      {"--ground=deep " + model, "'deep' is not a finite number"},
      {"--package robot " + model, "NAME=DIR"},
      {"--package robot=/no/such/folder " + model, "there is no folder"},
      {"--package robot=/tmp " + finger, "only URDF"},
      {"--ground " + finger, "plane already, geom 'floor'"},
      {"--base-pose 0,0,1 " + finger, "stands on the world itself"},
  };
  for (const auto& [arguments, says] : bad) {
    const Outcome o = Fork1s("inspect " + arguments);
    EXPECT_EQ(o.code, 2) << arguments << o.err;
    EXPECT_NE(o.err.find(says), std::string::npos) << arguments << ": " << o.err;
    EXPECT_TRUE(o.out.empty()) << o.out;
  }
}

TEST(Start, PosesOutsideTheLimitsAreSaid) {
  const Outcome o = Fork1s("inspect --q knee=30 " + Write("hopper.urdf", HopperUrdf()));
  EXPECT_EQ(o.code, 0);
  EXPECT_NE(o.out.find("30 rad is outside its limits -1 to 2 rad: it starts at the nearest, 2 rad"),
            std::string::npos)
      << o.out;
}

TEST(Start, KeepStart_LeavesAJointOutsideItsLimits) {
  const std::string leg = Write("leg.xml", R"(<mujoco><worldbody><body name="thigh">
      <joint name="knee" axis="0 1 0" range="30 70"/><geom size=".1" pos=".3 0 0"/></body></worldbody></mujoco>)");
  const Outcome inside = Fork1s("run --time 0.05 --json " + leg),
                kept = Fork1s("run --time 0.05 --keep-start --json " + leg);
  ASSERT_EQ(inside.code, 0) << inside.err;
  ASSERT_EQ(kept.code, 0) << kept.err;
  EXPECT_NE(inside.out.find("joint 'knee': the file starts it outside its limits"), std::string::npos);
  EXPECT_NE(kept.out.find("joint 'knee': starts outside its limits, as the file has it"), std::string::npos);
  const auto turn = [](const Outcome& o) {
    return std::abs(o.Json()["interface"][0]["quaternion_wxyz"][2].get<double>());
  };
  EXPECT_GT(turn(inside), .25);  // sin(15°) = 0.2588
  EXPECT_LT(turn(kept), .05);
}

TEST(Start, FilesOfGazeboAreRefusedWithAConverter) {
  const Outcome o = Fork1s("inspect " + Write("robot.sdf", "<sdf version='1.9'><model name='m'/></sdf>"));
  EXPECT_EQ(o.code, 3);
  EXPECT_NE(o.err.find("sdf2mjcf robot.sdf robot.xml"), std::string::npos) << o.err;
  EXPECT_TRUE(o.out.empty()) << o.out;
}

// A level arm of 1 kg at 0.5 m sags by θ where k (θ) = m g l cos θ; without --hold its servo turns it to 0.
TEST(Start, Hold_KeepsThePostureOfTheStartUpToTheSag) {
  const std::string arm =
      Write("servo.xml", R"(<mujoco><compiler angle="radian"/><worldbody><body name="arm" pos="0 0 1">
      <joint name="lift" axis="0 1 0" ref="1.2"/><geom size=".05" mass="1" pos=".5 0 0"/></body></worldbody>
      <actuator><position name="lift" joint="lift" kp="200" kv="20"/></actuator></mujoco>)");
  double sag = 0;
  for (int i = 0; i < 50; ++i) sag = 9.81 * .5 * std::cos(sag) / 200;
  const auto turn = [](const Outcome& o) {
    const auto q = o.Json()["interface"][0]["quaternion_wxyz"].get<std::vector<double>>();
    return 2 * std::atan2(q[2], q[0]);
  };
  const Outcome held = Fork1s("run --time 3 --hold --json " + arm),
                file = Fork1s("run --time 3 --json " + arm);
  ASSERT_EQ(held.code, 0) << held.err;
  EXPECT_NEAR(turn(held), sag, 1e-5);  // what is left of the swing, whose time constant is 0.1 s
  EXPECT_LT(turn(file), -1.1);
}

TEST(Packages, OptionAndEnvironment) {
  const auto folder = ScratchFolder() / "prefix" / "share" / "hopper_description";
  std::filesystem::create_directories(folder / "meshes");
  Write("prefix/share/hopper_description/meshes/foot.dae", TetrahedronDae());
  std::filesystem::create_directories(ScratchFolder() / "apart");
  const std::string model = Write(
      "apart/hopper.urdf", HopperUrdf(R"(<mesh filename="package://hopper_description/meshes/foot.dae"/>)"));
  const Outcome missing = Fork1s("inspect " + model);
  EXPECT_EQ(missing.code, 3);
  for (const char* part :
       {"hopper.urdf, line", "foot.dae", "link 'foot'", "the option package, hopper_description=DIR"})
    EXPECT_NE(missing.err.find(part), std::string::npos) << missing.err;
  const Outcome given =
      Fork1s("inspect --json --package hopper_description=" + folder.string() + " " + model);
  ASSERT_EQ(given.code, 0) << given.err;
  EXPECT_EQ(given.Json()["mechanisms"][0]["interfaces"][0],
            "foot");  // one object and nothing else on the output
  setenv("AMENT_PREFIX_PATH", (ScratchFolder() / "prefix").c_str(), 1);
  EXPECT_EQ(Fork1s("inspect " + model).code, 0);
  unsetenv("AMENT_PREFIX_PATH");
  setenv("ROS_PACKAGE_PATH", (ScratchFolder() / "prefix/share").c_str(), 1);
  EXPECT_EQ(Fork1s("inspect " + model).code, 0);
  unsetenv("ROS_PACKAGE_PATH");
}

TEST(Meshes, DamageIsRefusedAndNothingElseIsPrinted) {
  const std::string foot = R"(<mesh filename="foot.EXT"/>)";
  const std::pair<const char*, std::string> damaged[] = {
      {"stl", std::string(80, ' ') + "\xff\xff\xff\xff" + std::string(50, '\0')},
      {"obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 9\n"},
      {"dae", TetrahedronDae().substr(0, 700)},
      {"glb", "glTF"},
  };
  for (const auto& [extension, content] : damaged) {
    Write(std::string("foot.") + extension, content);
    std::string mesh = foot;
    mesh.replace(mesh.find("EXT"), 3, extension);
    const Outcome o = Fork1s("run " + Write("hopper.urdf", HopperUrdf(mesh)));
    EXPECT_EQ(o.code, 3) << extension << o.err;
    EXPECT_TRUE(o.out.empty()) << o.out;
    EXPECT_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1) << o.err;  // one sentence
    EXPECT_NE(o.err.find(std::string("foot.") + extension), std::string::npos) << o.err;
  }
}

// A start that the importer makes of options is no keyframe of the file.
TEST(Start, IsNamedByTheKeyframeOfTheFileAndTheOptionsThatChangeIt) {
  const std::string arm = Write("keyed.xml", R"(<mujoco><compiler angle="radian"/><worldbody>
    <body name="arm"><joint name="j" axis="0 1 0"/><geom size=".1" pos=".5 0 0"/></body></worldbody>
    <actuator><position joint="j" kp="100" kv="9"/></actuator>
    <keyframe><key name="standing" qpos=".2"/></keyframe></mujoco>)");
  const auto assumed = [&](const std::string& options) {
    const Outcome o = Fork1s("run --json --steps 1 " + options + " " + arm);
    return std::pair(o.code, o.Json()["assumed"]);
  };
  const std::pair<const char*, const char*> cases[] = {
      {"--hold", "the pose of the file, set-points by --hold"},
      {"--keyframe standing", "keyframe 'standing'"},
      {"--keyframe standing --hold", "keyframe 'standing', set-points by --hold"},
      {"--keyframe standing --q j=.3", "keyframe 'standing', joints by --q"}};
  for (const auto& [options, start] : cases) {
    const auto [code, json] = assumed(options);
    ASSERT_EQ(code, 0);
    EXPECT_EQ(json["start"], start);
    if (std::string(options) == "--hold")
      EXPECT_TRUE(json["keyframe"].is_null());
    else
      EXPECT_EQ(json["keyframe"], "standing");
    const Outcome o = Fork1s("inspect --json " + std::string(options) + " " + arm);
    EXPECT_EQ(o.Json()["keyframes"], nlohmann::json::array({"standing"})) << options;
  }
  EXPECT_NE(Fork1s("run --steps 1 --keyframe standing --hold " + arm)
                .out.find("from keyframe 'standing', set-points by --hold"),
            std::string::npos);
}

TEST(Pd, HelpSaysThatMotorsGiveWay) {
  EXPECT_NE(Fork1s("run --help").out.find("each motor gives way"), std::string::npos);
  const std::string arm =
      Write("motors.xml", R"(<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0"/>
    <geom size=".1" pos=".2 0 0"/><body pos=".4 0 0"><joint name="k" axis="0 1 0"/><geom size=".1" pos=".2 0 0"/>
    </body></body></worldbody><actuator><motor name="m" joint="j"/></actuator></mujoco>)");
  const auto all = Fork1s("inspect --json --pd 100,2 " + arm).Json();
  EXPECT_EQ(all["mechanisms"][0]["controls"], nlohmann::json::array({"j"}));
  EXPECT_EQ(all["holds"][1]["held_by"], "nothing");  // 'k' has no motor
  const auto one = Fork1s("inspect --json --pd j=100,2 " + arm).Json();
  EXPECT_EQ(one["mechanisms"][0]["controls"], nlohmann::json::array({"m", "j"}));
  const auto every = Fork1s("inspect --json --pd all=100,2 " + arm).Json();
  EXPECT_EQ(every["mechanisms"][0]["controls"], nlohmann::json::array({"m", "j", "k"}));
}

// Which of two arms floats is not known: exit code 3, as of other faults of a file.
TEST(Start, SeveralFixedTreesAreNotTakenApart) {
  const std::string arm = "'><joint axis='0 1 0'/><geom size='.1'/></body>";
  const std::string model = Write("arms.xml", "<mujoco><worldbody><body name='left" + arm +
                                                  "<body name='right" + arm + "</worldbody></mujoco>");
  const Outcome o = Fork1s("run --base floating " + model);
  EXPECT_EQ(o.code, 3);
  for (const char* part : {"arms.xml", "base", "'left' and 'right'", "into one <body>"})
    EXPECT_NE(o.err.find(part), std::string::npos) << o.err;
}

}  // namespace
}  // namespace fork1s::test
