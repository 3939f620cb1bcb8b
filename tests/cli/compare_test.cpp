// fork1s compare as a user types it.
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

TEST(Compare, HasThePromisedKeys) {
  const std::string model = Write("finger.xml", FingerModel());
  const Outcome o = Fork1s("compare --json --time 0.5 " + model);
  ASSERT_EQ(o.code, 0) << o.err;
  const auto json = o.Json();
  for (const char* key : {"against", "integrator", "halved_steps", "interface", "free_bodies",
                          "force_rms_percent", "frequencies_hz", "gap_max_mm", "energy_J", "wall_s",
                          "wall_ratio", "equal_dt", "cost", "unconverged_steps", "warnings"})
    EXPECT_TRUE(json.contains(key)) << key;
  ASSERT_EQ(json["interface"].size(), 1u);
  for (const char* key : {"body", "rms_mm", "max_mm", "rms_deg"})
    EXPECT_TRUE(json["interface"][0].contains(key)) << key;
  EXPECT_EQ(json["interface"][0]["body"], "tip");
  EXPECT_EQ(json["free_bodies"][0]["body"], "ball");
  // A ball that falls: both take the same steps, but for parts of the one in which it lands, which leave it 4 and 1.5 um
  // deep in the floor.
  EXPECT_LT(json["free_bodies"][0]["max_mm"].get<double>(), 5e-3);
  EXPECT_EQ(json["frequencies_hz"]["full"].size(), 2u);
  EXPECT_EQ(json["equal_dt"].size(), 3u);
}

// The full run is stepped at the order of the reduced one, or as told, and that is said.
TEST(Compare, StepsTheFullModelAtTheSameOrder) {
  const std::string model = Write("finger.xml", FingerModel());
  const std::string options = "compare --time 0.2 --refinements 0 ";
  const auto integrators = [&](const std::string& more) {
    const Outcome o = Fork1s(options + "--json " + more + model);
    EXPECT_EQ(o.code, 0) << o.err;
    return o.Json()["integrator"].dump();
  };
  EXPECT_EQ(integrators(""), R"({"full":"two-stages","reduced":"two-stage"})");
  EXPECT_EQ(integrators("--integrator euler "), R"({"full":"euler","reduced":"euler"})");
  EXPECT_EQ(integrators("--full-integrator euler "), R"({"full":"euler","reduced":"two-stage"})");
  EXPECT_EQ(integrators("--against mujoco "), R"({"reduced":"two-stage"})");
  const Outcome text = Fork1s(options + "--integrator euler --full-integrator two-stages " + model);
  EXPECT_NE(text.out.find("reduced by euler, full by two-stages"), std::string::npos) << text.out;
  EXPECT_NE(Fork1s(options + "--full-integrator leapfrog " + model).code, 0);
}

TEST(Compare, AgainstMuJoCo) {
  const std::string model = Write("finger.xml", FingerModel());
  const Outcome o = Fork1s("compare --json --against mujoco --time 0.2 --dt 0.001 --refinements 0 " + model);
  ASSERT_EQ(o.code, 0) << o.err;
  const auto json = o.Json();
  EXPECT_EQ(json["against"], "mujoco");
  EXPECT_EQ(json["other_dt_s"], 0.002);
  EXPECT_TRUE(json["contact_pairs"]["mujoco_only"].is_array());
  EXPECT_TRUE(json["contact_pairs"]["reduced_only"].is_array());
  // First-order steps of 1 and 2 ms on a finger that swings by some centimetres.
  EXPECT_LT(json["interface"][0]["max_mm"].get<double>(), 1);
}

// Before any figure: by what laws MuJoCo computes the file, and what of it only MuJoCo has.
TEST(Compare, SaysWhatMuJoCoDoesDifferently) {
  const std::string soft = Write("soft.xml", FingerModel());
  const std::string options = "compare --against mujoco --time 0.1 --dt 0.002 --refinements 0 ";
  const Outcome o = Fork1s(options + soft);
  ASSERT_EQ(o.code, 0) << o.err;
  const auto laws = o.out.find("time constant of 0.02 s"), figures = o.out.find("RMS mm");
  ASSERT_NE(laws, std::string::npos) << o.out;
  EXPECT_LT(laws, figures);
  EXPECT_NE(o.out.find("pyramid"), std::string::npos) << o.out;
  // A file that asks for other laws gets other sentences.
  std::string text = FingerModel(
      "<tendon><spatial name='rope' rgba='1 0 0 1'><site site='s'/><site "
      "site='t'/></spatial></tendon><sensor><user dim='1'/></sensor>");
  text.replace(text.find("<option "), 8, "<option cone='elliptic' noslip_iterations='3' ");
  text.replace(text.find("<geom name=\"floor\""), 0, "<site name='s'/><site name='t' pos='0 0 1'/>");
  const auto json = Fork1s(options + "--json " + Write("elliptic.xml", text)).Json();
  EXPECT_EQ(json["laws"].dump().find("pyramid"), std::string::npos) << json["laws"].dump(1);
  EXPECT_EQ(json["laws"].dump().find("creeps"), std::string::npos) << json["laws"].dump(1);
  EXPECT_EQ(json["laws"].size(), 1u) << json["laws"].dump(1);
  EXPECT_FALSE(json["dropped"].empty());
}

// How deep a body sinks in is what it does in the run: a ball whose contact starts soft and hardens within 30
// mm.
TEST(Compare, SaysHowDeepBodiesSinkInMuJoCo) {
  const std::string model = Write(
      "sink.xml",
      "<mujoco><default><geom solimp='.015 1 .03'/></default><worldbody><geom type='plane' size='1 1 .1'/>"
      "<body name='ball' pos='0 0 .05'><freejoint/><geom type='sphere' size='.05' mass='1'/></body>"
      "</worldbody></mujoco>");
  const auto json = Fork1s("compare --json --against mujoco --time 3 --refinements 0 " + model).Json();
  const std::string laws = json["laws"].dump(), words = "sinks in by up to ";
  const auto at = laws.find(words);
  ASSERT_NE(at, std::string::npos) << laws;
  const double said = std::stod(laws.substr(at + words.size()));
  // Two digits are said; the ball has come to rest long before the end, from above.
  EXPECT_NEAR(json["free_bodies"][0]["rms_mm"].get<double>(), said, 0.1 * said) << laws;
}

// A hand's palm that is driven by a table. In MuJoCo a body without a joint stands still.
std::string DrivenPalm(const std::string& palm) {
  return "<mujoco><option gravity='0 0 0' timestep='.001'/><custom><text name='fork1s_interface' "
         "data='finger'/>"
         "<text name='fork1s_base' data='driven'/></custom><worldbody><body name='palm'" +
         palm +
         "><geom type='box' size='.05 .05 .02'/><body name='finger' pos='.05 0 .02'><joint name='k' axis='0 "
         "-1 0' "
         "damping='.01'/><geom type='capsule' fromto='0 0 .02 0 0 .08' size='.008' mass='.05'/></body></body>"
         "</worldbody><actuator><position name='p' joint='k' kp='5' kv='.1'/></actuator></mujoco>";
}

TEST(Compare, RefusesControlsThatMuJoCoHasNoActuatorFor) {
  const std::string fixed = Write("palm_fixed.xml", DrivenPalm("")),
                    mocap = Write("palm_mocap.xml", DrivenPalm(" mocap='true'")),
                    moves = Write("palm_moves.csv", "time,palm.x,p\n0,0,0\n0.1,0.1,0\n"),
                    rests = Write("palm_rests.csv", "time,palm.x,p\n0,0,0\n0.1,0,0.2\n");
  const std::string options = "compare --against mujoco --time 0.2 --refinements 0 --controls ";
  const Outcome refused = Fork1s(options + moves + " " + fixed);
  EXPECT_EQ(refused.code, 3) << refused.out;
  EXPECT_EQ(refused.out, "");
  for (const char* part : {"palm_fixed.xml", "'palm.x'", "no actuator", "body 'palm'", "mocap=\"true\""})
    EXPECT_NE(refused.err.find(part), std::string::npos) << part << " in\n" << refused.err;
  // What stays at its start moves nothing that MuJoCo would have to move.
  const Outcome rest = Fork1s(options + rests + " --json " + fixed);
  ASSERT_EQ(rest.code, 0) << rest.err;
  EXPECT_LT(rest.Json()["interface"][0]["max_mm"].get<double>(), 1);
  // The remedy works: both palms go the same 100 mm.
  const Outcome driven = Fork1s(options + moves + " --json " + mocap);
  ASSERT_EQ(driven.code, 0) << driven.err;
  EXPECT_LT(driven.Json()["interface"][0]["max_mm"].get<double>(), 20);
  EXPECT_NE(driven.Json()["laws"].dump().find("without velocity"), std::string::npos);
}

// Options that change the model reach MuJoCo by a file that is written for it.
TEST(Compare, GivesMuJoCoTheModelWithItsOptions) {
  const std::string model = Write("finger.xml", FingerModel());
  const std::string command =
      "compare --json --against mujoco --time 0.2 --dt 0.002 --refinements 0 --interface tip ";
  for (const char* option : {"--pd 1,0.1 --q knuckle=-0.5", "--q end=0.1", "--base fixed"}) {
    const Outcome o = Fork1s(command + option + " " + model);
    ASSERT_EQ(o.code, 0) << option << "\n" << o.err;
    EXPECT_LT(o.Json()["interface"][0]["max_mm"].get<double>(), 1) << option;
  }
  const Outcome scaled = Fork1s("compare --against mujoco --time 0.1 --stiffness-scale 2 " + model);
  EXPECT_EQ(scaled.code, 2);
  EXPECT_EQ(scaled.out, "");
  EXPECT_NE(scaled.err.find("--stiffness-scale"), std::string::npos) << scaled.err;
}

// A keyframe puts the mocap body that is a driven base.
TEST(Compare, StartsMocapBodiesWhereTheKeyframeHasThem) {
  const std::string model = Write("palm.xml", R"(<mujoco><option gravity="0 0 0" timestep=".001"/><worldbody>
      <body name="palm" mocap="true"><geom size=".05"/><body name="finger" pos=".1 0 0">
      <joint name="knuckle" axis="0 1 0" stiffness="1" damping=".1"/><geom size=".03" pos=".1 0 0"/></body></body>
      </worldbody><keyframe><key name="up" mpos="0 0 1"/></keyframe></mujoco>)");
  const Outcome o =
      Fork1s("compare --json --against mujoco --keyframe up --time 0.05 --refinements 0 " + model);
  ASSERT_EQ(o.code, 0) << o.err;
  EXPECT_LT(o.Json()["interface"][0]["max_mm"].get<double>(), 0.01);
  const Outcome inspected = Fork1s("inspect " + model);
  EXPECT_NE(inspected.out.find("controls: palm.x, palm.y, palm.z, palm.rx, palm.ry, palm.rz"),
            std::string::npos)
      << inspected.out;
}

// A joint that the file has outside its limits starts inside them on both sides.
TEST(Compare, GivesMuJoCoTheStart) {
  const std::string model = Write("leg.xml", R"(<mujoco><option timestep=".001" gravity="0 0 0"/><worldbody>
      <body name="thigh"><joint name="knee" axis="0 1 0" range="30 70" damping="1"/>
      <geom size=".1" pos=".3 0 0"/></body></worldbody></mujoco>)");
  const Outcome moved = Fork1s("compare --json --against mujoco --time 0.05 --refinements 0 " + model);
  ASSERT_EQ(moved.code, 0) << moved.err;
  EXPECT_LT(moved.Json()["interface"][0]["max_deg"].get<double>(), 0.01);
}

// A hinge and a slide on a base that falls onto a plane, in a file that MuJoCo by itself reads otherwise.
std::string UrdfArm() {
  const std::string inertial =
      "<inertial><origin xyz='0 0 .05'/><mass value='.4'/><inertia ixx='.002' ixy='0' ixz='0' iyy='.002' "
      "iyz='0' "
      "izz='.001'/></inertial>";
  return "<robot name='arm'><link name='foot'>" + inertial +
         "<collision><geometry><box size='.2 .2 .02'/></geometry></collision></link><link name='upper'>" +
         inertial + "</link><link name='lower'>" + inertial +
         "</link><joint name='knee' type='revolute'><parent link='foot'/><child link='upper'/><axis xyz='0 1 "
         "0'/>"
         "<limit lower='-1' upper='1' effort='50' velocity='1'/></joint><joint name='lift' "
         "type='prismatic'><parent "
         "link='upper'/><child link='lower'/><origin xyz='0 0 .1'/><axis xyz='0 0 1'/><limit lower='-.05' "
         "upper='.05' effort='50' velocity='1'/></joint></robot>";
}

TEST(Compare, AUrdfWithMuJoCo) {
  const std::string model = Write("arm.urdf", UrdfArm());
  const auto temporary = ScratchFolder() / "temporary";
  std::filesystem::create_directories(temporary);
  const auto difference = [&](const std::string& options) {
    const Outcome o = Fork1s(
        "compare --json --against mujoco --dt 0.001 --refinements 0 --interface lower --pd lift=2000,20 " +
            options + " " + model,
        "TMPDIR=" + temporary.string());
    EXPECT_EQ(o.code, 0) << o.err;
    return o.Json()["interface"][0]["max_mm"].get<double>();
  };
  EXPECT_LT(difference("--time 0.3 --pd 20,1 --q knee=.3"), 0.5);
  // In free fall; MuJoCo's steps of h = 2 ms fall g h t/2 = 1.47 mm too far.
  EXPECT_LT(difference("--time 0.15 --pd 200,5 --base floating --base-pose 0,0,0.2 --ground"), 1.5);
  EXPECT_TRUE(std::filesystem::is_empty(temporary));
}

TEST(Exports, AModelAsMjcf) {
  const std::string model = Write("arm.urdf", UrdfArm()), out = (ScratchFolder() / "arm_export.xml").string();
  const Outcome o = Fork1s("export --base floating --pd 20,1 --q knee=.3 " + model + " " + out);
  ASSERT_EQ(o.code, 0) << o.err;
  EXPECT_NE(o.out.find("--keyframe start"), std::string::npos) << o.out;
  EXPECT_NE(Slurp(out).find("actuatorfrcrange"), std::string::npos);  // effort bounds PD control too
  EXPECT_EQ(Fork1s("run --time 0.1 --keyframe start " + out).code, 0);
  EXPECT_EQ(Fork1s("export " + model + " " + out).code, 0);  // its own file is replaced
  const std::string own = Write("own.xml", FingerModel());
  EXPECT_EQ(Fork1s("export " + model + " " + own).code, 3);  // another is not
  EXPECT_EQ(Slurp(own), FingerModel());
  for (const char* line : {"export --fps 3 ", "export --stiffness-scale 2 "})
    EXPECT_EQ(Fork1s(line + model + " " + out).code, 2) << line;
  const std::string recording = (ScratchFolder() / "of_arm.h5").string();
  ASSERT_EQ(Fork1s("run --time 0.05 --record " + recording + " " + own).code, 0);
  EXPECT_EQ(Fork1s("export " + recording + " " + out).code, 2);
  EXPECT_EQ(Fork1s("export --pd 1,1 " + recording + " " + (ScratchFolder() / "tables").string()).code, 2);
}

TEST(Compare, WritesAReport) {
  const std::string model = Write("finger.xml", FingerModel());
  const auto page = ScratchFolder() / "report.html";
  const Outcome o =
      Fork1s("compare --time 0.2 --refinements 1 --recovery twist --report " + page.string() + " " + model);
  EXPECT_EQ(o.code, 0) << o.err;
  EXPECT_NE(Slurp(page).find("</html>"), std::string::npos);
  EXPECT_EQ(o.err.find('\r'), std::string::npos);  // no progress bar in a pipe
  EXPECT_EQ(Fork1s("compare --time 0.1 --refinements 0 --report /nowhere/at/all.html " + model).code, 3);
}

TEST(Compare, RefusesAndSaysWhy) {
  const std::string model = Write("finger.xml", FingerModel());
  EXPECT_EQ(Fork1s("compare --against nobody " + model).code, 2);
  EXPECT_EQ(Fork1s("compare --time -1 " + model).code, 2);
  EXPECT_EQ(Fork1s("compare " + (ScratchFolder() / "missing.xml").string()).code, 3);
  const std::string table = Write("wrong.csv", "time,twist_it\n0,0\n");
  const Outcome o = Fork1s("compare --controls " + table + " " + model);
  EXPECT_EQ(o.code, 3);
  EXPECT_NE(o.err.find("twist_it"), std::string::npos) << o.err;
}

}  // namespace
}  // namespace fork1s::test
