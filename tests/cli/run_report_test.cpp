// What a run says at its end: loads by pair of bodies, bases, slip, stops and servos; and its tables.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "command.hpp"

namespace fork1s::test {
namespace {

const double kG = 9.81;

// A sledge of 2 kg on the floor, with a mast on a spring; it floats, so that it has a base.
std::string Sledge(const std::string& friction = "0.5") {
  return Write("sledge.xml", R"(<mujoco model="sledge"><option gravity="0 0 -9.81"/>
  <custom><text name="fork1s_interface" data="mast"/></custom>
  <worldbody><geom name="floor" type="plane" size="9 9 .1" friction=")" +
                                 friction + R"( 0 0"/>
    <body name="sledge" pos="0 0 .05"><freejoint/>
      <geom type="box" size=".1 .1 .05" mass="1.9" friction=")" +
                                 friction + R"( 0 0"/>
      <body name="mast" pos="0 0 .05"><joint name="hinge" type="hinge" axis="0 1 0" stiffness="5" damping=".1"
                                             limited="true" range="-20 20"/>
        <geom type="capsule" fromto="0 0 .02 0 0 .1" size=".01" mass=".1" contype="0" conaffinity="0"/></body>
    </body></worldbody></mujoco>)");
}

const nlohmann::json* Pair(const nlohmann::json& run, const std::string& a, const std::string& b) {
  for (const auto& c : run["contacts"])
    if (c["bodies"][0] == a && c["bodies"][1] == b) return &c;
  return nullptr;
}

TEST(RunReport, ForcesByPairCarryTheWeight) {
  const Outcome o = Fork1s("run --json --time 2 " + Sledge());
  ASSERT_EQ(o.code, 0) << o.err;
  const auto json = o.Json();
  const auto* floor = Pair(json, "world", "sledge");
  ASSERT_NE(floor, nullptr) << json["contacts"].dump(1);
  EXPECT_NEAR((*floor)["force_N"][2].get<double>(), 2 * kG, 1e-3);
  EXPECT_NEAR((*floor)["moment_Nm"][1].get<double>(), 0, 1e-3);
  EXPECT_GE((*floor)["force_max_N"].get<double>(), (*floor)["force_N"][2].get<double>() - 1e-9);
  EXPECT_LT((*floor)["slip_m"].get<double>(), 1e-4);
  EXPECT_TRUE((*floor)["slip_first_s"].is_null());
}

// The box of 2 kg lies still; the lever turns about its axis at a constant rate.
TEST(RunReport, Sensors_AreValuesOfTheLastStep) {
  const std::string model = Write("sensors.xml", R"(<mujoco model="sensors"><worldbody>
    <geom type="plane" size="9 9 .1"/>
    <body name="box" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="2"/>
      <site name="top" pos="0 0 .1"/><site name="under" type="box" size=".2 .2 .05" pos="0 0 -.1"/></body>
    <body name="lever" pos="2 0 1"><joint name="turn" axis="0 0 1"/><geom size=".1" pos=".2 0 0"/></body></worldbody>
    <sensor><accelerometer name="acc" site="top"/><touch name="weight" site="under"/><jointvel name="rate" joint="turn"/>
    <clock name="clock"/><user name="own" dim="2"/></sensor>
    <keyframe><key name="turning" qpos="0 0 .1 1 0 0 0 0" qvel="0 0 0 0 0 0 .5"/></keyframe></mujoco>)");
  const std::string recording = (ScratchFolder() / "sensors.h5").string();
  const Outcome o = Fork1s("run --json --time 1 --keyframe turning --record " + recording + " " + model);
  ASSERT_EQ(o.code, 0) << o.err;
  const auto json = o.Json();
  const auto& sensors = json["sensors"];
  ASSERT_EQ(sensors.size(), 5u) << sensors.dump();
  // The contact is compliant, and the box at rest after a second up to what it still sinks.
  EXPECT_NEAR(sensors["acc"][2].get<double>(), kG, 1e-4);
  EXPECT_NEAR(sensors["weight"][0].get<double>(), 2 * kG, 1e-3);
  EXPECT_NEAR(sensors["rate"][0].get<double>(), 0.5, 1e-9);
  EXPECT_NEAR(sensors["clock"][0].get<double>(), 1, 1e-12);
  EXPECT_EQ(sensors["own"].dump(), "[null,null]");
  EXPECT_EQ(json["sensors_missing"].size(), 1u);
  EXPECT_EQ(json["sensors_missing"]["own"], "a program of the user computes it");

  // The last row of the table of the recording has the same numbers.
  const std::string folder = (ScratchFolder() / "sensors").string();
  ASSERT_EQ(Fork1s("export " + recording + " " + folder).code, 0);
  std::istringstream table(Slurp(folder + "/sensors.csv"));
  std::string header, row;
  std::getline(table, header);
  EXPECT_EQ(header, "time,acc.0,acc.1,acc.2,weight,rate,clock,own.0,own.1");
  int rows = 0;
  for (std::string line; std::getline(table, line); ++rows) row = line;
  EXPECT_EQ(rows, json["steps"].get<int>());
  std::istringstream cells(row);
  std::vector<std::string> last;
  for (std::string cell; std::getline(cells, cell, ',');) last.push_back(cell);
  ASSERT_EQ(last.size(), 9u) << row;
  for (int k = 0; k < 3; ++k)
    EXPECT_EQ(std::stod(last[static_cast<std::size_t>(1 + k)]),
              sensors["acc"][static_cast<std::size_t>(k)].get<double>());
  EXPECT_EQ(std::stod(last[4]), sensors["weight"][0].get<double>());
  EXPECT_EQ(std::stod(last[5]), sensors["rate"][0].get<double>());
  EXPECT_EQ(last[7], "nan");
  EXPECT_EQ(last[8], "nan");

  // Before the first step there is no mean over it.
  const Outcome start = Fork1s("run --json --steps 0 --keyframe turning " + model);
  ASSERT_EQ(start.code, 0) << start.err;
  EXPECT_EQ(start.Json()["sensors"]["acc"].dump(), "[null,null,null]");
  EXPECT_NEAR(start.Json()["sensors"]["rate"][0].get<double>(), 0.5, 1e-12);
}

// A pendulum of two links that swings down from horizontal.
TEST(RunReport, CausesOfRelinearization) {
  const std::string loose = Write("loose.xml", R"(<mujoco model="loose">
  <custom><text name="fork1s_interface" data="tip"/><numeric name="fork1s_modes" data="0"/></custom>
  <worldbody><body name="upper"><joint name="a" axis="0 1 0" damping=".02" stiffness=".1"/>
    <geom type="capsule" fromto="0 0 0 .2 0 0" size=".01" mass=".1"/>
    <body name="lower" pos=".2 0 0"><joint name="b" axis="0 1 0" damping=".02" stiffness=".1"/>
      <geom type="capsule" fromto="0 0 0 .2 0 0" size=".01" mass=".1"/>
      <body name="third" pos=".2 0 0"><joint name="c" axis="0 1 0" damping=".02" stiffness=".1"/>
        <geom type="capsule" fromto="0 0 0 .2 0 0" size=".01" mass=".1"/>
        <body name="tip" pos=".2 0 0"><joint name="d" axis="0 1 0" damping=".02" stiffness=".1"/>
          <geom type="capsule" fromto="0 0 0 .2 0 0" size=".01" mass=".1"/></body></body></body></body></worldbody></mujoco>)");
  const Outcome o = Fork1s("run --json --time 1 " + loose);
  ASSERT_EQ(o.code, 0) << o.err;
  const auto json = o.Json();
  const auto& causes = json["refreshes_by_cause"];
  const auto& turned = causes["turned_joint"];
  ASSERT_GT(turned["count"], 0) << json.dump(1);
  EXPECT_GT(turned["largest"], 0.2617);  // rad, 15 degrees
  EXPECT_EQ(turned["unit"], "rad");
  EXPECT_EQ(turned["of"].get<std::string>().rfind("joint '", 0), 0U) << turned;
  EXPECT_EQ(causes["loop_gap"]["count"], 0);
  EXPECT_TRUE(causes["loop_gap"]["of"].is_null());
  int count = 0;
  for (const auto& cause : causes) count += cause["count"].get<int>();
  EXPECT_EQ(count, json["refreshes"]);
  const std::string text = Fork1s("run --time 1 " + loose).out;
  EXPECT_NE(text.find(" since a joint had turned, by "), std::string::npos) << text;
}

// Jaws that press a box by N each and lift it by a constant force: m (g + a)/(2 µ N) of its friction is in use.
TEST(RunReport, FrictionUseOfALiftedBoxIsItsClosedForm) {
  const std::string model =
      Write("lifted.xml", R"(<mujoco><custom><text name="fork1s_interface" data="left right"/></custom>
    <default><geom friction="0.6"/></default><worldbody>
    <body name="carriage" pos="0 0 1"><joint name="lift" type="slide" axis="0 0 1"/>
      <geom type="box" size="0.02 0.02 0.02" pos="0 0 0.2" mass="1"/>
      <body name="left" pos="-0.06 0 0"><joint name="l" type="slide" axis="1 0 0"/><geom type="box" size="0.01 0.02 0.02" mass="0.1"/></body>
      <body name="right" pos="0.06 0 0"><joint name="r" type="slide" axis="-1 0 0"/><geom type="box" size="0.01 0.02 0.02" mass="0.1"/></body>
    </body><body name="box" pos="0 0 1"><freejoint/><geom type="box" size="0.05 0.015 0.015" mass="0.2"/></body></worldbody>
    <actuator><motor name="up" joint="lift"/><motor name="a" joint="l"/><motor name="b" joint="r"/></actuator></mujoco>)");
  // 1.4 kg in all at g + 2 m/s².
  const std::string table = Write("lifted.csv", "time,up,a,b\n0,16.534,10,10\n1,16.534,10,10\n");
  const Outcome o = Fork1s("run --json --time 0.6 --controls " + table + " " + model);
  ASSERT_EQ(o.code, 0) << o.err;
  const auto use = o.Json()["friction_use"];
  ASSERT_EQ(use.size(), 1u) << use.dump();
  EXPECT_EQ(use[0]["body"], "box");
  const double closed = 0.2 * 11.81 / (2 * 0.6 * 10);
  EXPECT_NEAR(use[0]["course"].back()["use"].get<double>(), closed, 0.01 * closed);
  EXPECT_NEAR(use[0]["margin_min"].get<double>(), 1 - use[0]["max"].get<double>(), 1e-12);
}

// Set down on the floor, dragged at 5 N for half a second, then lifted off: the load at the end says nothing.
TEST(RunReport, LoadsAfterAReleaseAreThoseOfTheContact) {
  const std::string run = "run --time 1 --push sledge:5,0,0:0.2..0.7 --push sledge:0,0,40:0.7..1 " + Sledge();
  const Outcome json_run = Fork1s("run --json" + run.substr(3));
  ASSERT_EQ(json_run.code, 0) << json_run.err;
  const auto json = json_run.Json();
  const auto* floor = Pair(json, "world", "sledge");
  ASSERT_NE(floor, nullptr);
  const auto& mean = (*floor)["mean"];
  const auto& peak = (*floor)["peak"];
  EXPECT_EQ((*floor)["force_N"][2].get<double>(), 0);
  EXPECT_FALSE((*floor)["touches_at_end"].get<bool>());
  EXPECT_NEAR((*floor)["touched_last_s"].get<double>(), 0.7, 0.02);
  EXPECT_NEAR(mean["force_N"][2].get<double>(), 2 * kG, 0.2);
  EXPECT_NEAR(mean["normal_N"].get<double>(), 2 * kG, 0.2);
  // 5 N of friction for 0.5 of 0.7 s, and the static friction limit is µ f_n = 9.81 N.
  EXPECT_NEAR(mean["force_N"][0].get<double>(), -5 * 0.5 / 0.7, 0.2);
  EXPECT_NEAR(mean["tangential_N"].get<double>(), 5 * 0.5 / 0.7, 0.3);
  EXPECT_NEAR(mean["friction_use"].get<double>(), 5 * 0.5 / 0.7 / kG, 0.03);
  EXPECT_NEAR(peak["normal_N"].get<double>(), peak["force_N"][2].get<double>(), 1e-6);
  EXPECT_LE((*floor)["friction_use_max"].get<double>(), 1 + 1e-6);
  EXPECT_GE((*floor)["friction_use_max"].get<double>(), 5 / kG - 0.02);
  const auto& base = json["bases"][0];
  EXPECT_NEAR(base["start_m"][2].get<double>(), 0.05, 1e-12);
  const double rise = base["position_m"][2].get<double>() - 0.05;
  EXPECT_GT(rise, 0.3);
  EXPECT_NEAR(base["path_m"].get<double>(), rise, 1e-3);
  const std::string text = Fork1s(run).out;
  for (const char* part :
       {"peak, ", "mean ", "normal ", "tangential ", "of its friction", "last at 0.", "path "})
    EXPECT_NE(text.find(part), std::string::npos) << part << " in\n" << text;
}

TEST(RunReport, BeginsWithWhatIsAssumed) {
  const std::string model = Write("finger.xml", FingerModel()), table = Write("b.csv", "time,bend\n0,0.1\n");
  const Outcome text = Fork1s("run --steps 3 --dt 0.01 " + model);
  ASSERT_EQ(text.code, 0) << text.err;
  const auto summary = text.out.find("3 steps of 0.01 s");
  for (const char* part :
       {"two-stage", "gravity (0, 0, -9.81)", "the pose of the file", "mechanism 'proximal'",
        "contact at tip (named)", "no --controls: the one control stays where it starts"}) {
    const auto at = text.out.find(part);
    ASSERT_NE(at, std::string::npos) << part << " in\n" << text.out;
    EXPECT_LT(at, summary) << part;
  }
  const auto assumed = Fork1s("run --json --steps 1 --controls " + table + " " + model).Json()["assumed"];
  EXPECT_EQ(assumed["controls"], table);
  EXPECT_EQ(assumed["mechanisms"][0]["coordinates_full"], 2);
  EXPECT_EQ(assumed["mechanisms"][0]["interfaces"][0], "tip");
  EXPECT_TRUE(assumed["keyframe"].is_null());
}

TEST(RunReport, StepsInPlaceOfTime) {
  const std::string model = Write("finger.xml", FingerModel());
  const auto json = Fork1s("run --json --steps 7 --dt 0.003 " + model).Json();
  EXPECT_EQ(json["steps"], 7);
  EXPECT_NEAR(json["simulated_s"].get<double>(), 0.021, 1e-12);
  EXPECT_TRUE(json["warnings"].empty()) << json["warnings"].dump(1);
  EXPECT_EQ(Fork1s("run --steps 7 --time 1 " + model).code, 2);
  EXPECT_EQ(Fork1s("run --steps -1 " + model).code, 2);
  EXPECT_EQ(Fork1s("run --steps 7 --accuracy 1mm " + model).code, 2);
}

TEST(RunReport, LimitsThatTheStartIsOutsideOfHaveTheirUnit) {
  const auto warnings = [](const std::string& joint, const std::string& tendon) {
    return Fork1s("run --json --steps 1 --keep-start " +
                  Write("outside.xml",
                        "<mujoco><compiler angle='radian'/><worldbody><site name='w' pos='0 0 1'/>"
                        "<body name='a' pos='0 0 .2'><joint name='j' " +
                            joint + "/><geom size='.1'/><site name='s'/></body></worldbody>" + tendon +
                            "</mujoco>"))
        .Json()["warnings"]
        .dump();
  };
  const std::string rope =
      warnings("type='slide' axis='0 0 1'",
               "<tendon><spatial name='rope' limited='true' range='0 .5'><site site='w'/>"
               "<site site='s'/></spatial></tendon>");
  EXPECT_NE(rope.find("tendon 'rope' starts outside its limits by 0.3 m;"), std::string::npos) << rope;
  EXPECT_EQ(rope.find("beyond its"), std::string::npos) << rope;
  const std::string hinge = warnings("type='hinge' axis='0 1 0' limited='true' range='.25 1'", "");
  EXPECT_NE(hinge.find("joint 'j' starts outside its limits by 0.25 rad;"), std::string::npos) << hinge;
}

TEST(RunReport, WhatSlipsIsNamed) {
  // 15 N against 0.5 * 19.6 N of friction: 2.6 m/s² for half a second, 0.32 m, and as far again to rest, less
  // what friction takes then.
  const Outcome o = Fork1s("run --json --time 0.5 --push sledge:15,0,0 " + Sledge());
  ASSERT_EQ(o.code, 0) << o.err;
  const auto json = o.Json();
  const auto* floor = Pair(json, "world", "sledge");
  ASSERT_NE(floor, nullptr);
  const double moved = json["bases"][0]["position_m"][0].get<double>();
  EXPECT_GT(moved, 0.25);
  EXPECT_NEAR((*floor)["slip_m"].get<double>(), moved, 0.1 * moved);
  EXPECT_NEAR((*floor)["force_N"][0].get<double>(), -0.5 * 2 * kG, 0.3);
  EXPECT_NEAR(json["bases"][0]["velocity_m_per_s"][0].get<double>(), (15 - kG) / 2 * 0.5, 0.1);
  EXPECT_NE(Fork1s("run --time 0.5 --push sledge:15,0,0 " + Sledge()).out.find("slipped"), std::string::npos);
}

// A rod let go level swings through the bottom at sqrt(3 g/l), 5.4 rad/s.
TEST(RunReport, JointsFasterThanTheirFileAllows_AreTold) {
  const auto rod = [](const std::string& velocity) {
    return Write("rod" + velocity + ".urdf",
                 R"(<robot name="rod"><link name="base"/><link name="rod"><inertial>
      <origin xyz=".5 0 0"/><mass value="1"/><inertia ixx="1e-6" iyy=".083333" izz=".083333" ixy="0" ixz="0" iyz="0"/>
      </inertial></link><joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
      <limit lower="-9" upper="9" effort="1" velocity=")" +
                     velocity + R"("/></joint></robot>)");
  };
  const double fastest = std::sqrt(3 * kG);
  const auto run = Fork1s("run --json --time 1 --dt 0.002 " + rod("5")).Json();
  ASSERT_EQ(run["speed_limits_passed"].size(), 1u);
  const auto& passed = run["speed_limits_passed"][0];
  EXPECT_EQ(passed["joint"], "hinge");
  EXPECT_EQ(passed["unit"], "rad/s");
  EXPECT_EQ(passed["limit"], 5);
  EXPECT_NEAR(passed["speed_max"].get<double>(), fastest, 1e-3 * fastest);
  EXPECT_LT(passed["first_s"].get<double>(), passed["speed_max_s"].get<double>());
  EXPECT_NE(run["warnings"].dump().find("joint 'hinge' moved at"), std::string::npos);
  for (const char* above : {"6", "0"})  // 0: not given
    EXPECT_TRUE(Fork1s("run --json --time 1 --dt 0.002 " + rod(above)).Json()["speed_limits_passed"].empty());
}

// A chain of stiff joints of which only the tip is an interface: a push in its middle bends condensed joints.
TEST(RunReport, JointsBetweenInterfacesKeepTheirStops) {
  std::string open, close;
  for (int i = 1; i <= 10; ++i) {
    const std::string name = i == 10 ? "tip" : "l" + std::to_string(i);
    open +=
        "<body name='" + name + "' pos='" + (i > 1 ? ".05" : "0") + " 0 0'><joint name='t" +
        std::to_string(i) +
        "' axis='0 1 0' stiffness='20' damping='.05' armature='1e-5' limited='true' range='-15 15'/>"
        "<geom type='capsule' size='.01' fromto='0 0 0 .05 0 0' density='1000' contype='0' conaffinity='0'/>";
    close += "</body>";
  }
  const std::string model =
      Write("tail.xml", "<mujoco><custom><text name='fork1s_interface' data='tip'/></custom><worldbody>" +
                            open + close + "</worldbody></mujoco>");
  EXPECT_TRUE(Fork1s("run --json --time 0.5 " + model).Json()["stops_passed"].empty());
  // What the push bends gets coordinates of its own, and with them the stops that it reaches.
  const auto held = Fork1s("run --json --time 0.5 --push l6:0,0,-200 " + model).Json();
  EXPECT_TRUE(held["stops_passed"].empty());
  EXPECT_EQ(held["stops_reached"][0]["name"], "joint 't1'");
}

TEST(RunReport, StopsAndServosAtTheirEndsAreNamed) {
  const Outcome o = Fork1s("run --json --time 1 --push mast:0,0,0,0,4,0 " + Sledge());
  ASSERT_EQ(o.code, 0) << o.err;
  const auto stops = o.Json()["stops_reached"];
  ASSERT_EQ(stops.size(), 1u) << stops.dump(1);
  EXPECT_EQ(stops[0]["name"], "joint 'hinge'");
  EXPECT_EQ(stops[0]["end"], "upper");
  EXPECT_GT(stops[0]["steps"].get<int>(), 10);
  EXPECT_TRUE(Fork1s("run --json --time 1 " + Sledge()).Json()["stops_reached"].empty());

  const std::string weak =
      Write("weak.xml", FingerModel("<actuator><position name='weak' joint='knuckle' kp='1' "
                                    "forcelimited='true' forcerange='-.001 .001'/></actuator>"));
  const std::string table = Write("weak.csv", "time,weak\n0,0.5\n");
  const auto servos =
      Fork1s("run --json --time 1 --controls " + table + " " + weak).Json()["servos_at_limit"];
  ASSERT_GE(servos["which"].size(), 1u) << servos.dump(1);
  EXPECT_EQ(servos["which"][0]["name"], "actuator 'weak'");
  EXPECT_EQ(servos["which"][0]["steps"], servos["steps"]);
}

TEST(RunReport, LoadFactorOverTime) {
  const std::string scenes = std::string(FORK1S_SOURCE_DIR) + "/scenes/";
  const std::string run = "run --time 3.5 " + scenes + "grasp_box.xml --controls " + scenes + "grasp_box.csv";
  const Outcome o = Fork1s(run + " --json");
  ASSERT_EQ(o.code, 0) << o.err;
  const auto json = o.Json();
  const auto& course = json["load_factor"];
  ASSERT_GT(course.size(), 3u);
  double least = 1e300, before = -1;
  for (const auto& moment : course) {
    EXPECT_GT(moment["time_s"].get<double>(), before);
    before = moment["time_s"].get<double>();
    least = std::min(least, moment["factor"].get<double>());
    EXPECT_EQ(moment["body"], "box");
  }
  EXPECT_DOUBLE_EQ(least, json["load_factor_min"].get<double>());
  const std::string text = Fork1s(run).out;
  EXPECT_NE(text.find("thumb_tip on box"), std::string::npos) << text;
  EXPECT_NE(text.find("base palm"), std::string::npos) << text;
  EXPECT_NE(text.find("at least: "), std::string::npos) << text;
}

// The last row of a table by the names of its columns.
std::map<std::string, std::string> LastRow(const std::string& path) {
  std::stringstream text(Slurp(path));
  std::string header, line, last;
  std::getline(text, header);
  while (std::getline(text, line)) last = line;
  std::map<std::string, std::string> row;
  std::stringstream names(header), values(last);
  std::string name, value;
  while (std::getline(names, name, ',') && std::getline(values, value, ',')) row[name] = value;
  return row;
}

// Without a terminal a line every ten seconds, here of a clock that runs 10,000 times as fast.
TEST(RunReport, ProgressWithoutATerminalIsALineEveryTenSeconds) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the address sanitizer has to be loaded first";
#endif
  const std::string run = "run --time 20 --read-time 1e6 " + Sledge();
  EXPECT_EQ(Fork1s(run).err.find("simulating: "), std::string::npos);  // shorter than ten seconds
  const Outcome o = Fork1s(run, "env LD_PRELOAD=" FORK1S_FAST_CLOCK);
  ASSERT_EQ(o.code, 0) << o.err;
  std::stringstream text(o.err);
  int lines = 0, before = 0;
  for (std::string line; std::getline(text, line);) {
    int percent = -1;
    char sign = 0;
    if (std::sscanf(line.c_str(), "simulating: %d %c", &percent, &sign) != 2) continue;
    ++lines;
    EXPECT_EQ(sign, '%') << line;
    EXPECT_GE(percent, before) << o.err;
    EXPECT_LE(percent, 100) << o.err;
    before = percent;
  }
  EXPECT_GE(lines, 3) << o.err;
}

TEST(RunReport, TablesHoldTheSame) {
  const std::string file = (ScratchFolder() / "sledge.h5").string(),
                    folder = (ScratchFolder() / "sledge").string();
  const Outcome o = Fork1s("run --json --time 0.5 --push sledge:15,0,0 --record " + file + " " + Sledge());
  ASSERT_EQ(o.code, 0) << o.err;
  ASSERT_EQ(Fork1s("export " + file + " " + folder).code, 0);
  const auto json = o.Json();
  auto poses = LastRow(folder + "/poses.csv"), pairs = LastRow(folder + "/pairs.csv");
  const auto& base = json["bases"][0];
  EXPECT_DOUBLE_EQ(std::stod(poses["sledge.x"]), base["position_m"][0].get<double>());
  EXPECT_NEAR(std::stod(poses["sledge.vx"]), base["velocity_m_per_s"][0].get<double>(), 1e-12);
  EXPECT_NEAR(std::stod(poses["sledge.wy"]), base["angular_velocity_rad_per_s"][1].get<double>(), 1e-12);
  EXPECT_EQ(pairs["body_a"], "world");
  EXPECT_EQ(pairs["body_b"], "sledge");
  const auto* floor = Pair(json, "world", "sledge");
  ASSERT_NE(floor, nullptr);
  EXPECT_NEAR(std::stod(pairs["force.x"]), (*floor)["force_N"][0].get<double>(), 1e-9);
  EXPECT_NEAR(std::stod(pairs["force.z"]), (*floor)["force_N"][2].get<double>(), 1e-9);
}

TEST(Export, AMomentAfterTheEndIsSaid) {
  const std::string file = (ScratchFolder() / "short.h5").string(),
                    out = (ScratchFolder() / "late.png").string();
  ASSERT_EQ(Fork1s("run --time 0.2 --record " + file + " " + Sledge()).code, 0);
  // Said before the picture is drawn, for which a browser may be missing.
  EXPECT_NE(Fork1s("export --at 5 " + file + " " + out).err.find("after the end of the recording at 0.2 s"),
            std::string::npos);
}

TEST(Export, ColoursAreTheFilesUnlessAsked) {
  const std::string file = (ScratchFolder() / "short.h5").string();
  ASSERT_EQ(Fork1s("run --time 0.1 --record " + file + " " + Sledge()).code, 0);
  const Outcome o = Fork1s("export --color-by gaps " + file + " " + (ScratchFolder() / "c.glb").string());
  EXPECT_EQ(o.code, 2);
  EXPECT_NE(o.err.find("the file's colours"), std::string::npos) << o.err;
  EXPECT_EQ(Fork1s("export --color-by rainbow " + file + " " + (ScratchFolder() / "c.png").string()).code, 2);
}

}  // namespace
}  // namespace fork1s::test
