// Levels of detail from the command line: switched while a scene runs, refused where nothing is held.
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

const std::string kPeg = std::string(FORK1S_SOURCE_DIR) + "/scenes/peg_grasp.xml --controls " +
                         FORK1S_SOURCE_DIR + "/scenes/peg_in_hole.csv";

TEST(Detail, SwitchesWhileItRuns) {
  const std::string file = (ScratchFolder() / "peg.h5").string();
  const Outcome o =
      Fork1s("run --json " + kPeg +
             " --time 1 --detail interface,0.5:object,0.8:interface+modes=2+twist --record " + file);
  ASSERT_EQ(o.code, 0) << o.err;
  const auto json = o.Json();
  ASSERT_EQ(json["detail"].size(), 3u) << json.dump(1);
  EXPECT_EQ(json["detail"][1]["level"], "object");
  EXPECT_TRUE(json["detail"][1]["refused"].is_null());
  EXPECT_NEAR(json["detail"][1]["time_s"].get<double>(), 0.5, 1e-9);
  EXPECT_EQ(json["detail"][2]["recovery"], "twist");
  // Its pads slid while they closed: their friction is used up, and nothing has slipped further since.
  EXPECT_NEAR(json["hold_use_max"].get<double>(), 1, 0.01);
  const Outcome replay = Fork1s("replay " + file);
  EXPECT_EQ(replay.code, 0) << replay.out << replay.err;
}

// Where a face meets a capsule the surfaces roll about one axis only; about the other the stiffness is 0, and
// rounding must not make it less.
TEST(Detail, FacesOnCapsulesAreFrozenToo) {
  const std::string scenes = std::string(FORK1S_SOURCE_DIR) + "/scenes/";
  const Outcome o = Fork1s("run --json " + scenes + "grasp_box.xml --controls " + scenes +
                           "grasp_box.csv --time 3.5 --detail interface,3:object");
  ASSERT_EQ(o.code, 0) << o.err;
  const auto json = o.Json();
  ASSERT_EQ(json["detail"].size(), 2u);
  EXPECT_TRUE(json["detail"][1]["refused"].is_null()) << json["detail"].dump(1);
  // That fourteen frozen contacts repeat each other to the last digits is nothing a user could mend.
  EXPECT_EQ(json["warnings"].dump().find("last digits"), std::string::npos) << json["warnings"].dump(1);
  // How much harder it could press is told of frozen contacts as well.
  double before = 0, frozen = 0;
  for (const auto& moment : json["load_factor"])
    (moment["time_s"].get<double>() < 3.01 ? before : frozen) = moment["factor"].get<double>();
  EXPECT_GT(frozen, 0);
  EXPECT_NEAR(frozen / before, 1, 0.1);
}

// How two balls of a jaw share what it bears no balance tells; contacts share so that none slips, where they
// can.
TEST(Detail, AFirmGripIsNoWarning) {
  const std::string scene = std::string(FORK1S_SOURCE_DIR) + "/scenes/fourbar_gripper.xml";
  const auto frozen = [&](const std::string& options) {
    const Outcome o = Fork1s("run --json --time 1.5 --detail interface,1:object " + options + " " + scene);
    EXPECT_EQ(o.code, 0) << o.err;
    const auto json = o.Json();
    EXPECT_TRUE(json["detail"][1]["refused"].is_null()) << json["detail"].dump(1);
    return json["warnings"].dump().find("a frozen contact") != std::string::npos;
  };
  for (const char* closed : {"0.2", "0.22", "0.25"}) {
    const std::string table = Write(
        "close.csv", std::string("time,left_grip,right_grip\n0,0,0\n0.5,") + closed + "," + closed + "\n");
    EXPECT_FALSE(frozen("--controls " + table)) << closed;
    // Along the jaws, where nothing but friction holds it, 20 N are far more than they press: it would slip.
    EXPECT_TRUE(frozen("--controls " + table + " --push cube:0,20,0:1.2..1.5")) << closed;
  }
}

// Two arms that squeeze a box from both sides, each a mechanism of its own or both on one table.
std::string TwoArms(bool on_one_table) {
  std::string arms;
  for (const char* name : {"left", "right"}) {
    const std::string n = name, side = name[0] == 'l' ? "-" : "";
    arms += "<body name='" + n + "_foot' pos='" + side +
            ".1 0 .1'><geom type='box' size='.01 .02 .1' mass='1' contype='0' "
            "conaffinity='0'/><body name='" +
            n + "_hand' pos='0 0 .1'><joint name='" + n + "' type='slide' axis='" +
            (side.empty() ? "-1" : "1") +
            " 0 0' damping='20'/><geom type='box' size='.02 .05 .05' mass='.2'/></body></body>";
  }
  if (on_one_table) arms = "<body name='table'>" + arms + "</body>";
  return Write(on_one_table ? "table.xml" : "apart.xml",
               "<mujoco><option timestep='.01'/><custom><text name='fork1s_interface' data='left_hand "
               "right_hand'/></custom>"
               "<worldbody>" +
                   arms +
                   "<body name='box' pos='0 0 .2'><freejoint/><geom type='box' size='.078 .03 .03' "
                   "mass='.5'/></body></worldbody><actuator><position name='left' joint='left' kp='500'/>"
                   "<position name='right' joint='right' kp='500'/></actuator></mujoco>");
}

TEST(Detail, TwoMechanismsHoldAsOneOnOneTableDoes) {
  const std::string table = Write("squeeze.csv", "time,left,right\n0,.02,.02\n");
  const auto run = [&](bool on_one_table) {
    const Outcome o = Fork1s("run --json --time 1 --controls " + table + " --detail interface,.5:object " +
                             TwoArms(on_one_table));
    EXPECT_EQ(o.code, 0) << o.err;
    return o.Json();
  };
  const auto apart = run(false), table_top = run(true);
  for (const auto& held : {apart, table_top}) {
    EXPECT_TRUE(held["detail"][1]["refused"].is_null()) << held["detail"].dump(1);
    EXPECT_LT(held["hold_use_max"].get<double>(), 1);
    EXPECT_NE(held["interface"].dump().find("\"box\""), std::string::npos);  // part of the mechanism now
  }
  // Contacts keep the share that they had when they were frozen, which the solver tells to some 1e-6.
  EXPECT_NEAR(apart["hold_use_max"].get<double>(), table_top["hold_use_max"].get<double>(), 1e-4);
}

// Two bases that are driven cannot carry each other.
TEST(Detail, MechanismsThatCannotBecomeOneAreNamed) {
  const std::string table = Write("squeeze.csv", "time,left,right\n0,.02,.02\n");
  const Outcome o = Fork1s("run --json --time 1 --base driven --controls " + table +
                           " --detail interface,.5:object " + TwoArms(false));
  ASSERT_EQ(o.code, 0) << o.err;
  const std::string refused = o.Json()["detail"][1]["refused"].dump();
  for (const char* said : {"'left_foot'", "'right_foot'", "is driven", "one base"})
    EXPECT_NE(refused.find(said), std::string::npos) << refused;
}

TEST(Detail, WordsThatAreNoneAreUsageErrors) {
  for (const char* words : {"--detail fingers", "--detail modes=x", "--detail 1:all,0.5:object"}) {
    const Outcome o = Fork1s("run " + kPeg + " --time 0.1 " + words);
    EXPECT_EQ(o.code, 2) << words << o.err;
    EXPECT_NE(o.err.find("detail"), std::string::npos) << o.err;
  }
}

// Before the first step there is no contact to freeze; later it is said and the run goes on as it was.
TEST(Detail, NothingHeldIsSaid) {
  const Outcome first = Fork1s("run --json " + kPeg + " --time 0.1 --detail object");
  EXPECT_EQ(first.code, 2);
  EXPECT_NE(first.err.find("before the first step"), std::string::npos) << first.err;
  const Outcome hand =
      Fork1s("run --json " FORK1S_SOURCE_DIR "/scenes/hand.xml --time 0.1 --detail 0.05:object");
  ASSERT_EQ(hand.code, 0) << hand.err;
  EXPECT_NE(hand.Json()["warnings"].dump().find("holds nothing"), std::string::npos);
}

}  // namespace
}  // namespace fork1s::test
