// Every command on a good model: exit code 0, the promised keys, figures that make sense.
#include <algorithm>
#include <cmath>
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

TEST(Inspect, SaysWhatHoldsEachJoint) {
  const std::string model = Write("finger.xml", FingerModel());
  const Outcome text = Fork1s("inspect " + model);
  EXPECT_EQ(text.code, 0) << text.err;
  EXPECT_NE(text.out.find("knuckle"), std::string::npos);
  EXPECT_NE(text.out.find("spring 2"), std::string::npos) << text.out;
  auto json = Fork1s("inspect --json " + model).Json();
  EXPECT_EQ(json["mechanisms"][0]["interfaces"][0], "tip");
  EXPECT_EQ(json["mechanisms"][0]["modes"], 2);
  EXPECT_EQ(json["free_bodies"][0]["name"], "ball");
}

// A body that actuators move has its free joint to the world; so has a load that a tendon ties to a crane.
TEST(Inspect, BodiesOnFreeJoints_AreCalledFree) {
  const std::string drone =
      "<body name='drone' pos='0 3 0'><freejoint name='f'/><geom size='.1'/><site name='r'/></body>";
  const std::string load =
      "<body name='load' pos='0 0 .3'><freejoint/><geom size='.1'/><site name='eye'/></body>";
  const std::string boom =
      "<body name='boom' pos='0 0 1'><joint name='lift' type='slide' axis='0 0 1'/><geom size='.1'/>"
      "<site name='tip'/></body>";
  const std::string thrust = "<actuator><motor site='r' gear='0 0 1 0 0 0'/></actuator>",
                    jet = "<actuator><motor joint='f' gear='0 0 1 0 0 0'/></actuator>";
  const auto rope = [](const std::string& a, const std::string& b) {
    return "<tendon><spatial stiffness='9'><site site='" + a + "'/><site site='" + b +
           "'/></spatial></tendon>";
  };
  const std::string slides =
      "<body name='table'><joint type='slide' axis='1 0 0'/><joint type='slide' axis='0 1 0'/><joint "
      "type='ball'/><geom size='.1'/></body>";
  const struct {
    std::string bodies, rest, text;
    bool is_free;
    std::vector<std::string> free;
  } cases[] = {
      {drone, thrust, "mechanism 'drone': free body 'drone', 2", true, {"drone"}},
      {load + drone, jet, "mechanism 'drone': free body 'drone', 2", true, {"drone"}},
      {drone + load, rope("r", "eye"), ": free bodies 'drone' and 'load', 3", true, {"drone", "load"}},
      {load + boom, rope("tip", "eye"), ": base fixed, 'load' on a free joint, 3", false, {"load"}},
      {boom, "", ": base fixed, 2", false, {}},
      {slides, "", ": base fixed, 2", false, {}},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.text);
    const std::string model =
        Write("free.xml", "<mujoco><worldbody>" + c.bodies + "</worldbody>" + c.rest + "</mujoco>");
    const Outcome inspected = Fork1s("inspect " + model), run = Fork1s("run --time 0.1 " + model);
    EXPECT_NE(inspected.out.find(c.text), std::string::npos) << inspected.out << inspected.err;
    EXPECT_NE(run.out.find(c.text.substr(0, c.text.size() - 1)), std::string::npos) << run.out << run.err;
    for (const nlohmann::json& m :
         {Fork1s("inspect --json " + model).Json()["mechanisms"][0],
          Fork1s("run --json --time 0.1 " + model).Json()["assumed"]["mechanisms"][0]}) {
      EXPECT_EQ(m["base"], "fixed");
      EXPECT_EQ(m["is_free"], c.is_free);
      EXPECT_EQ(m["free_joint_bodies"].get<std::vector<std::string>>(), c.free);
    }
  }
}

TEST(Run, SaysWhichModesAreKeptAndWhatIsLeftOut) {
  std::string masses;
  for (const char* k : {"12", "25", "40", "60", "90", "200"})
    masses += std::string("<body pos='0 0 .1'><joint type='slide' axis='1 0 0' stiffness='") + k +
              "'/><geom size='.01' mass='.3' contype='0' conaffinity='0'/></body>";
  const std::string model = Write(
      "masses.xml",
      "<mujoco><option gravity='0 0 0'/><custom><text name='fork1s_interface' "
      "data='plate'/></custom><worldbody>"
      "<body name='plate'><joint type='slide' axis='1 0 0' stiffness='800'/><geom size='.1' mass='2'/>" +
          masses + "</body></worldbody></mujoco>");
  // sqrt(90 / 0.3) / 2π = 2.757 Hz
  const std::pair<const char*, const char*> cases[] = {
      {"run --time 0.1 ", "coordinates: 1 elastic, 6 modes; no motion left out"},
      {"run --time 0.1 --modes auto ", "coordinates: 1 elastic, 6 modes; no motion left out"},
      {"reduce ", "coordinates: 1 elastic, 6 modes; no motion left out"},
      {"reduce --modes 4 ", "coordinates: 1 elastic, 4 modes; 2 modes left out, from 2.76 Hz on: "},
      {"run --time 0.1 --modes 4 ", "coordinates: 1 elastic, 4 modes; 2 modes left out, from 2.76 Hz on: "},
      {"inspect ", "coordinates: 1 elastic, 6 modes; no motion left out"}};
  for (const auto& [arguments, line] : cases) {
    const Outcome o = Fork1s(arguments + model);
    EXPECT_EQ(o.code, 0) << o.err;
    EXPECT_NE(o.out.find(line), std::string::npos) << arguments << o.out;
  }
}

TEST(Reduce, HasThePromisedKeys) {
  const std::string model = Write("finger.xml", FingerModel());
  const Outcome o = Fork1s("reduce --json " + model);
  ASSERT_EQ(o.code, 0) << o.err;
  auto json = o.Json();
  for (const char* key : {"mass_kg", "dofs", "loop_rank", "interfaces", "compliance_world", "stiffness_world",
                          "frequencies_hz", "coordinates", "warnings"})
    EXPECT_TRUE(json.contains(key)) << key;
  EXPECT_NEAR(json["mass_kg"].get<double>(), 0.08, 1e-12);
  EXPECT_EQ(json["dofs"], 2);
  EXPECT_TRUE(json["stiffness_world"].is_null());  // two hinges cannot move a body in six ways
  // C_zz at the tip's origin, 50 mm from the knuckle: 0.05² / 2.
  EXPECT_NEAR(json["compliance_world"][5][5].get<double>(), 0.05 * 0.05 / 2, 1e-12);
  EXPECT_EQ(json["coordinates"]["elastic"].get<int>() + json["coordinates"]["modes"].get<int>(), 2);
}

TEST(Reduce, WritesAModelFile) {
  const std::string model = Write("finger.xml", FingerModel()),
                    file = (ScratchFolder() / "finger.h5").string();
  const Outcome o = Fork1s("reduce " + model + " --out " + file);
  EXPECT_EQ(o.code, 0) << o.err;
  EXPECT_GT(std::filesystem::file_size(file), 1000u);
}

TEST(Statics, LinearAndNonlinear) {
  const std::string model = Write("finger.xml", FingerModel());
  auto json = Fork1s("statics --json --body tip --force 0,0,-0.2 --gravity 0,0,0 " + model).Json();
  // Small load: 0.2 N on 50 mm against 2 N·m/rad turns the knuckle by 5 mrad.
  EXPECT_NEAR(json["linear"]["position_m"][2].get<double>(), 0.3 - 0.05 * 0.005, 1e-9);
  EXPECT_NEAR(json["position_m"][2].get<double>(), json["linear"]["position_m"][2].get<double>(), 1e-7);
  EXPECT_NEAR(json["max_joint_rotation_deg"].get<double>(), 0.005 * 180 / M_PI, 1e-4);
  EXPECT_TRUE(json["stable"].get<bool>());
}

TEST(Run, HasThePromisedKeys) {
  const std::string model = Write("finger.xml", FingerModel());
  const Outcome o = Fork1s("run --json --time 2 " + model);
  ASSERT_EQ(o.code, 0) << o.err;
  auto json = o.Json();
  for (const char* key :
       {"steps", "simulated_s", "wall_s", "real_time_factor", "contacts_max", "energy_J", "interface",
        "joint_gap_max_m", "step_us", "unconverged_steps", "halved_steps", "newton_iterations", "refreshes"})
    EXPECT_TRUE(json.contains(key)) << key;
  EXPECT_EQ(json["steps"], 120);  // 1/60 s unless asked otherwise
  EXPECT_EQ(json["unconverged_steps"], 0);
  EXPECT_EQ(json["contacts_max"], 1);  // the ball lands
  // At rest the ball's centre stands a radius above the floor, less the 10 µm that contact may give.
  EXPECT_NEAR(json["free_bodies"][0]["position_m"][2].get<double>(), 0.02, 1e-5);
  const auto& solver = json["contact_solver"];
  EXPECT_GT(solver["steps"].get<int>(), 60);
  EXPECT_EQ(solver["bearing_max"], 1);
  EXPECT_EQ(solver["helped_steps"], 0);
  EXPECT_GE(solver["iterations_max"].get<double>(), solver["iterations_mean"].get<double>());
  EXPECT_LT(solver["residual_max_N"].get<double>(), 1e-6);  // of a weight of some newtons
  EXPECT_LT(json["joint_gap_max_m"].get<double>(), 1e-12);
}

TEST(Run, FollowsControls) {
  const std::string model = Write("finger.xml", FingerModel());
  const std::string table = Write("bend.csv", "time,bend\n0,0\n0.5,0.4\n");
  auto held = Fork1s("run --json --time 2 " + model).Json();
  const Outcome o = Fork1s("run --json --time 2 --controls " + table + " " + model);
  ASSERT_EQ(o.code, 0) << o.err;
  const auto q0 = held["interface"][0]["quaternion_wxyz"], q1 = o.Json()["interface"][0]["quaternion_wxyz"];
  // Both turn about y: twice the difference of half angles is the set-point, but for what gravity changes.
  const double turned = 2 * (std::asin(q1[2].get<double>()) - std::asin(q0[2].get<double>()));
  EXPECT_NEAR(turned, 0.4, 0.01);
}

TEST(Run, TwistRecoveryAndStiffnessScale) {
  const std::string model = Write("finger.xml", FingerModel());
  for (const char* options :
       {"--recovery twist", "--stiffness-scale 1e4", "--dt 0.001", "--modes 0", "--base fixed"}) {
    const Outcome o = Fork1s(std::string("run --json --time 1 ") + options + " " + model);
    EXPECT_EQ(o.code, 0) << options << o.err;
    EXPECT_EQ(o.Json()["unconverged_steps"], 0) << options;
  }
}

TEST(Run, TakesAnIntegrator) {
  const std::string model = Write("finger.xml", FingerModel()), file = (ScratchFolder() / "run.h5").string();
  const Outcome o = Fork1s("run --json --time 1 --integrator euler --record " + file + " " + model);
  ASSERT_EQ(o.code, 0) << o.err;
  EXPECT_NEAR(o.Json()["free_bodies"][0]["position_m"][2].get<double>(), 0.02, 2e-4);
  EXPECT_EQ(Fork1s("replay " + file).code, 0);  // the recording knows how its steps were taken
  EXPECT_EQ(Fork1s("run --integrator leapfrog " + model).code, 2);
  const Outcome gone = Fork1s("run --integrator theta " + model);
  EXPECT_EQ(gone.code, 2);
  EXPECT_NE(gone.err.find("'two-stage', which is of second order too"), std::string::npos) << gone.err;
}

TEST(Run, SaysWhenAMotionBlowsUp) {
  // Exit 4 and a sentence with time and body, not a table of what means nothing.
  const std::string thrown =
      Write("thrown.xml",
            "<mujoco><worldbody><body name='stone'><freejoint/><geom size='.01' mass='1'/></body></worldbody>"
            "<keyframe><key name='k' qvel='4e8 0 0 0 0 0'/></keyframe></mujoco>");
  const Outcome o = Fork1s("run --time 1 --keyframe k " + thrown);
  EXPECT_EQ(o.code, 4);
  EXPECT_NE(o.err.find("'stone'"), std::string::npos) << o.err;
  EXPECT_NE(o.err.find("blown up"), std::string::npos) << o.err;
  EXPECT_NE(o.err.find("0.0166667 s"), std::string::npos) << o.err;
}

// Loops by their curvature: less work than closing them, a gap that stays below the one at which they are
// refreshed, and the motion of closed ones.
TEST(Run, CurvesLoops) {
  const std::string firemen = std::string(FORK1S_SOURCE_DIR) + "/scenes/firemen.xml";
  const std::string file = (ScratchFolder() / "curved.h5").string();
  const Outcome exact = Fork1s("run --json --time 1 " + firemen);
  const Outcome curved = Fork1s("run --json --time 1 --recovery curved --record " + file + " " + firemen);
  ASSERT_EQ(curved.code, 0) << curved.err;
  const auto a = exact.Json(), b = curved.Json();
  EXPECT_LT(a["joint_gap_max_m"].get<double>(), 1e-8);
  EXPECT_GT(b["joint_gap_max_m"].get<double>(), 1e-6);
  EXPECT_LT(b["joint_gap_max_m"].get<double>(), 2e-4);
  // The sheet has come down by 0.1 m and thrown its load back.
  for (int k = 0; k < 3; ++k)
    EXPECT_NEAR(a["interface"][0]["position_m"][k].get<double>(),
                b["interface"][0]["position_m"][k].get<double>(), 1e-3);
  EXPECT_EQ(Fork1s("replay " + file).code, 0);
  const Outcome unknown = Fork1s("run --recovery bent " + firemen);
  EXPECT_EQ(unknown.code, 2);
  EXPECT_NE(unknown.err.find("curved"), std::string::npos) << unknown.err;
}

TEST(Record, ReplaysAndExports) {
  const std::string model = Write("finger.xml", FingerModel());
  const std::string file = (ScratchFolder() / "run.h5").string(), folder = (ScratchFolder() / "csv").string();
  ASSERT_EQ(Fork1s("run --time 1 --record " + file + " " + model).code, 0);
  std::filesystem::remove(model);  // a recording stands on its own
  const Outcome replay = Fork1s("replay --json " + file);
  EXPECT_EQ(replay.code, 0) << replay.err;
  EXPECT_TRUE(replay.Json()["identical"].get<bool>());
  EXPECT_EQ(replay.Json()["steps"], 60);
  EXPECT_EQ(Fork1s("export " + file + " " + folder).code, 0);
  const std::string poses = Slurp(folder + "/poses.csv");
  EXPECT_EQ(poses.substr(0, 9), "time,tip.");
  EXPECT_GE(std::count(poses.begin(), poses.end(), '\n'), 61);
}

TEST(Record, ExportsMovingScenes) {
  const std::string model = Write("finger.xml", FingerModel());
  const std::string file = (ScratchFolder() / "run.h5").string(),
                    out = (ScratchFolder() / "run.glb").string();
  ASSERT_EQ(Fork1s("run --time 1 --record " + file + " " + model).code, 0);
  const Outcome o = Fork1s("export " + file + " " + out);
  EXPECT_EQ(o.code, 0) << o.err;
  const std::string sixty = Slurp(out);
  EXPECT_EQ(sixty.substr(0, 4), "glTF");
  ASSERT_EQ(Fork1s("export --fps 10 " + file + " " + out).code, 0);
  EXPECT_LT(Slurp(out).size(), sixty.size());
  const std::string text = (ScratchFolder() / "run.gltf").string();
  ASSERT_EQ(Fork1s("export " + file + " " + text).code, 0);
  EXPECT_EQ(nlohmann::json::parse(Slurp(text))["asset"]["version"], "2.0");
}

TEST(Json, PrintsNothingElseOnStandardOutput) {
  const std::string model = Write("finger.xml", FingerModel());
  for (const char* command : {"inspect", "reduce", "statics --body tip --force 0,0,1", "run --time 0.1"}) {
    const Outcome o = Fork1s(std::string(command) + " --json " + model);
    EXPECT_EQ(o.code, 0) << command;
    EXPECT_NO_THROW(o.Json()) << command;
  }
}

TEST(Progress, SilentInAPipe) {
  const std::string model = Write("finger.xml", FingerModel());
  const Outcome o = Fork1s("run --time 1 " + model);
  EXPECT_EQ(o.err.find('\r'), std::string::npos);
}

// Statics has no stops, and says where that matters.
TEST(Statics, JointsBeyondTheirStopsAreNamed) {
  const std::string model = Write(
      "stop.xml",
      "<mujoco><worldbody><body name='lever'><joint name='pivot' axis='0 1 0' range='-10 10' stiffness='1'/>"
      "<geom type='capsule' fromto='0 0 0 .1 0 0' size='.01' mass='.1'/><body name='end' pos='.1 0 0'>"
      "<geom size='.01' mass='.1'/></body></body></worldbody></mujoco>");
  const auto warnings = [&](const std::string& load) {
    return Fork1s("statics --json --body end --gravity 0,0,0 --force 0,0," + load + " " + model)
        .Json()["warnings"];
  };
  EXPECT_TRUE(warnings("1").empty());  // 0.1 N m: 5.7 degrees
  EXPECT_EQ(warnings("3").size(), 1u);
  EXPECT_NE(warnings("3").dump().find("pivot"), std::string::npos) << warnings("3");
}

// What gravity does without the load is said beside what the load does with it; a pose that servos do not
// hold shows there.
TEST(Statics, WhatItIsWithoutTheLoadStandsBesideIt) {
  const std::string model = Write("finger.xml", FingerModel());
  const auto at = [&](const std::string& options) {
    return Fork1s("statics --json --body tip " + options + model).Json();
  };
  const auto loaded = at("--force 0,0,0.1 "), alone = at("");
  EXPECT_EQ(loaded["unloaded"]["position_m"], alone["position_m"]);
  EXPECT_NE(loaded["position_m"], alone["position_m"]);
  const auto moved = at("--gravity 0,0,0 --q end=0.5 ")["unloaded"]["max_joint_rotation_deg"].get<double>();
  EXPECT_NEAR(moved, 0.5 * 57.29577951308232, 1e-6);  // its servo asks for 0
}

}  // namespace
}  // namespace fork1s::test
