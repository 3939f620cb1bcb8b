// What reduce, statics and inspect say of mechanisms under load.
#include <numbers>

#include "command.hpp"

namespace fork1s::test {
namespace {

std::string Mast(double stiffness) {
  return Write(
      "mast.xml",
      "<mujoco><option gravity='0 0 -9.81'/><worldbody><body name='mast' pos='0 0 .5'>"
      "<joint name='foot' axis='0 1 0' stiffness='" +
          std::to_string(stiffness) +
          "'/>"
          "<inertial pos='0 0 .4' mass='1.5' diaginertia='.002 .002 .002'/>"
          "<geom type='capsule' fromto='0 0 0 0 0 .8' size='.01' mass='0'/></body></worldbody></mujoco>");
}

TEST(Loaded, ReduceHasStiffnessAndFrequenciesUnderWeight) {
  const std::string model = Mast(10);
  const auto json = Fork1s("reduce --json " + model).Json();
  const double k = 10 - 1.5 * 9.81 * 0.4, inertia = 0.002 + 1.5 * 0.16, turn = 2 * std::numbers::pi;
  EXPECT_NEAR(json["frequencies_hz"]["full"][0].get<double>(), std::sqrt(10 / inertia) / turn, 1e-9);
  EXPECT_NEAR(json["compliance_world"][1][1].get<double>(), 0.1, 1e-12);
  const auto& loaded = json["loaded"];
  EXPECT_NEAR(loaded["frequencies_hz"][0].get<double>(), std::sqrt(k / inertia) / turn, 1e-8);
  ASSERT_EQ(loaded["mode_pairs"].size(), 1u);
  EXPECT_EQ(loaded["mode_pairs"][0]["mode"], 0);
  EXPECT_NEAR(loaded["mode_pairs"][0]["agreement"].get<double>(), 1, 1e-9);
  EXPECT_NEAR(loaded["compliance_world"][1][1].get<double>(), 1 / k, 1e-8);
  EXPECT_NEAR(loaded["lowest_stiffness_Nm"].get<double>(), k, 1e-7);
  EXPECT_TRUE(loaded["stable"].get<bool>());
  const std::string text = Fork1s("reduce " + model).out;
  for (const char* said : {"of the springs alone", "about the loaded equilibrium", "0.2431", "0.656213"})
    EXPECT_NE(text.find(said), std::string::npos) << text;
}

// The mast that hangs is the slower one without its weight, and the faster one with it.
TEST(Loaded, ReduceListsFrequenciesUnderWeightBesideThoseOfTheSameShape) {
  const auto mast = [](const std::string& name, const std::string& x, const std::string& k,
                       const std::string& z) {
    return "<body name='" + name + "' pos='" + x + " 0 1'><joint name='" + name +
           "' axis='0 1 0' stiffness='" + k + "'/><inertial pos='0 0 " + z +
           "' mass='1.5' diaginertia='.002 .002 .002'/></body>";
  };
  const std::string model =
      Write("masts.xml",
            "<mujoco><option gravity='0 0 -9.81'/>"
            "<custom><text name='fork1s_interface' data='sledge'/></custom><worldbody><body name='sledge'>"
            "<joint name='x' type='slide' axis='1 0 0' stiffness='1e5'/><geom size='.1' mass='20'/>" +
                mast("up", "0", "10", ".4") + mast("down", "1", "8", "-.4") + "</body></worldbody></mujoco>");
  const auto json = Fork1s("reduce --json " + model).Json();
  const auto &loaded = json["loaded"]["frequencies_hz"], &pairs = json["loaded"]["mode_pairs"];
  ASSERT_EQ(pairs.size(), 3u);
  const double inertia = 0.002 + 1.5 * 0.16, weight = 1.5 * 9.81 * 0.4, turn = 2 * std::numbers::pi;
  const double by_shape[] = {8 + weight,
                             10 - weight};  // of the mast that is slowest, and next, by its spring
  for (std::size_t i = 0; i < 2; ++i) {
    const auto mode = pairs[i]["mode"].get<std::size_t>();
    EXPECT_EQ(mode, 1 - i);
    // The sledge yields by 15 N/(1e5 N/m) of a radian, a thousandth of the masts' stiffness.
    EXPECT_NEAR(loaded[mode].get<double>(), std::sqrt(by_shape[i] / inertia) / turn, 2e-3);
  }
  const std::string text = Fork1s("reduce " + model).out;
  EXPECT_NE(text.find("shape %"), std::string::npos) << text;
}

TEST(Loaded, ReduceSaysThatAnEquilibriumIsUnstable) {
  const auto json = Fork1s("reduce --json " + Mast(5)).Json();
  EXPECT_FALSE(json["loaded"]["stable"].get<bool>());
  EXPECT_TRUE(json["loaded"]["frequencies_hz"].empty());
  EXPECT_NE(json["warnings"].dump().find("unstable"), std::string::npos) << json["warnings"];
}

// A bead of two slides between two cables, taut by 200 N.
std::string Bead(double springlength) {
  const std::string cable = " stiffness='2000' springlength='" + std::to_string(springlength) + "'>";
  return Write("bead.xml",
               "<mujoco><option gravity='0 0 0'/><worldbody><site name='l' pos='-.5 0 1'/>"
               "<site name='r' pos='.5 0 1'/><body name='bead' pos='0 0 1'>"
               "<joint name='x' type='slide' axis='1 0 0'/><joint name='z' type='slide' axis='0 0 1'/>"
               "<geom type='sphere' size='.03' mass='.5'/><site name='b'/></body></worldbody><tendon>"
               "<spatial name='tl'" +
                   cable +
                   "<site site='l'/><site site='b'/></spatial>"
                   "<spatial name='tr'" +
                   cable +
                   "<site site='b'/><site site='r'/></spatial>"
                   "</tendon></mujoco>");
}

TEST(Loaded, PrestressHoldsABeadBetweenCables) {
  const auto json = Fork1s("statics --json --body bead --force 0,0,-10 " + Bead(0.4)).Json();
  EXPECT_NEAR(json["linear"]["position_m"][2].get<double>(), 1 - 0.0125, 1e-9);
  EXPECT_NEAR(json["position_m"][2].get<double>(), 1 - 0.0125, 5e-5);
  EXPECT_TRUE(json["stable"].get<bool>());
  EXPECT_EQ(json["branch"], "primary");
  const std::string text = Fork1s("statics --body bead --force 0,0,-10 " + Bead(0.4)).out;
  EXPECT_NE(text.find(" N m/rad\n"), std::string::npos) << text;
  const auto held = Fork1s("inspect --json " + Bead(0.4)).Json();
  EXPECT_TRUE(held["not_held"].empty()) << held["not_held"];
  EXPECT_EQ(held["held_by_load"], nlohmann::json({"z"}));
  // Cables without tension hold nothing across them.
  const Outcome slack = Fork1s("statics --json --body bead --force 0,0,-10 " + Bead(0.5));
  EXPECT_EQ(slack.code, 3) << slack.out;
  EXPECT_NE(slack.err.find("joint 'z'"), std::string::npos) << slack.err;
  EXPECT_EQ(Fork1s("inspect --json " + Bead(0.5)).Json()["not_held"].size(), 1u);
}

TEST(Loaded, SnapThroughIsFollowedAndSaid) {
  // Two sprung bars from a fixed pin to an apex that slides, as one by symmetry: 2 N per N of a bar.
  const std::string model = Write(
      "truss.xml",
      "<mujoco><compiler angle='radian'/><option gravity='0 0 0'/><worldbody><site name='pin' pos='-.3 0 0'/>"
      "<body name='apex' pos='0 0 .1'><joint name='z' type='slide' axis='0 0 1'/>"
      "<geom size='.01' mass='.05'/><site name='top'/></body></worldbody><tendon>"
      "<spatial name='bar' stiffness='4000' springlength='.31622776601683794'><site site='pin'/>"
      "<site site='top'/></spatial></tendon></mujoco>");
  const std::string command = "statics --body apex --force=0,0,-8.6 " + model;
  const auto json = Fork1s(command + " --json").Json();
  EXPECT_NEAR(json["position_m"][2].get<double>(), -0.11734, 1e-5);
  EXPECT_TRUE(json["stable"].get<bool>());
  EXPECT_EQ(json["branch"], "beyond limit points");
  EXPECT_EQ(json["limit_shares"].size(), 2u);
  const std::string text = Fork1s(command).out;
  for (const char* said : {"stable equilibrium", "limit points", "snaps through"})
    EXPECT_NE(text.find(said), std::string::npos) << text;
}

TEST(Loaded, StaticsHasStiffnessAtAPointAndBucklingLoads) {
  const std::string command = "statics --body mast --point 0,0,.8 --force 0,0,-1 --buckling 2 " + Mast(10);
  const auto json = Fork1s(command + " --json").Json();
  const double k = 10 - 1.5 * 9.81 * 0.4, loaded = k - 0.8;
  EXPECT_NEAR(json["reference_position_m"][2].get<double>(), 1.3, 1e-12);
  EXPECT_NEAR(json["lowest_stiffness_Nm"].get<double>(), loaded, 1e-7);
  EXPECT_NEAR(json["stiffness_along_axes_N_per_m"][0].get<double>(), loaded / 0.64, 1e-6);
  EXPECT_TRUE(json["stiffness_along_axes_N_per_m"][1].is_null());
  EXPECT_TRUE(json["stiffness_world"].is_null());
  ASSERT_EQ(json["buckling"].size(), 1u);
  EXPECT_NEAR(json["buckling"][0]["factor"].get<double>(), k / 0.8, 1e-6);
  EXPECT_EQ(json["buckling"][0]["mode"]["foot"], 1.0);
  const std::string text = Fork1s(command).out;
  EXPECT_NEAR(json["frequencies_hz"]["springs"][0].get<double>(), 1.02309, 1e-5);
  EXPECT_NEAR(json["frequencies_hz"]["loaded"][0].get<double>(),
              std::sqrt(loaded / 0.242) / (2 * std::numbers::pi), 1e-7);
  for (const char* said : {"[N/m]:", "rigid", "of the springs alone: 1.0231; about this equilibrium: 0.588",
                           "buckles at 5.1425 times the load", "foot 1"})
    EXPECT_NE(text.find(said), std::string::npos) << text;
  // Half-way along the lever a force turns it half as far, and moves it a quarter.
  const auto sideways =
      Fork1s("statics --json --gravity 0,0,0 --body mast --point 0,0,.4 --force .1,0,0 " + Mast(10)).Json();
  EXPECT_NEAR(sideways["linear"]["position_m"][0].get<double>(), 0.1 * 0.16 / 10, 1e-12);
  EXPECT_EQ(Fork1s("statics --body mast --point 0,x,0 " + Mast(10)).code, 2);
}

TEST(Loaded, PointsOfBodiesHaveStiffnessWithoutAndUnderLoad) {
  const std::string options = " --along=1,0,1 --point mast:0,0,.5 --point mast:0,0,0 " + Mast(10);
  const double k = 10 / 0.25, loaded = k - 1.5 * 9.81 * 0.4 / 0.25;
  for (const std::string command : {"reduce", "statics"}) {
    const auto json = Fork1s(command + " --json" + options).Json();
    ASSERT_EQ(json["points"].size(), 2u) << json;
    const auto& top = json["points"][0];
    EXPECT_EQ(top["body"], "mast");
    EXPECT_NEAR(top["reference_position_m"][2].get<double>(), 1, 1e-12);
    EXPECT_NEAR(top["springs"]["stiffness_along_axes_N_per_m"][0].get<double>(), k, 1e-9);
    EXPECT_NEAR(top["loaded"]["stiffness_along_axes_N_per_m"][0].get<double>(), loaded, 1e-6);
    EXPECT_NEAR(top["loaded"]["stiffness_along_N_per_m"].get<double>(), 2 * loaded, 1e-6);
    EXPECT_TRUE(top["springs"]["stiffness_along_axes_N_per_m"][2].is_null());
    EXPECT_TRUE(json["points"][1]["springs"]["stiffness_along_axes_N_per_m"][0].is_null());
    const std::string text = Fork1s(command + options).out;
    for (const char* said :
         {"of the springs alone", "about the equilibrium", "rigid", "'mast' at [0.0,0.0,0.5] m"})
      EXPECT_NE(text.find(said), std::string::npos) << text;
  }
  // The bead is free across slack cables, and the cables' pull holds it where they are taut.
  for (const double springlength : {0.4, 0.5}) {
    const auto json = Fork1s("reduce --json --point bead:0,0,0 " + Bead(springlength)).Json();
    const auto &springs = json["points"][0]["springs"], &held = json["points"][0]["loaded"];
    EXPECT_NEAR(springs["stiffness_along_axes_N_per_m"][0].get<double>(), 4000, 1e-6);
    EXPECT_EQ(springs["stiffness_along_axes_N_per_m"][2], 0.0);
    EXPECT_NE(springs["free_motions"].dump().find("joint 'z'"), std::string::npos);
    EXPECT_NEAR(held["stiffness_along_axes_N_per_m"][2].get<double>(), springlength < 0.5 ? 800 : 0, 1e-4);
    EXPECT_EQ(held["free_motions"].size(), springlength < 0.5 ? 0u : 1u);
  }
  const std::string slack = Fork1s("reduce --point bead:0,0,0 " + Bead(0.5)).out;
  EXPECT_NE(slack.find("rigid        free"), std::string::npos) << slack;
  for (const char* wrong :
       {"reduce --point 0,0,0 ", "reduce --point x:0,0,0 ", "reduce --point mast:0,0 ",
        "statics --along=0,0,0 --point mast:0,0,0 ", "statics --point x:0,0,0 ", "statics "})
    EXPECT_EQ(Fork1s(wrong + Mast(10)).code, 2) << wrong;
}

}  // namespace
}  // namespace fork1s::test
