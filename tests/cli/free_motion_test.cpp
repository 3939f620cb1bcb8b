// What nothing holds, as `reduce` and `inspect` tell it.
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

// Three links; a servo holds the sum of the last two joints only.
std::string CoupledFinger() {
  return R"(<mujoco model="finger">
  <compiler angle="radian"/>
  <custom><text name="fork1s_interface" data="tip"/></custom>
  <worldbody>
    <body name="palm"><geom size=".02" mass=".1"/>
      <body name="proximal" pos=".03 0 0"><joint name="knuckle" axis="0 1 0" stiffness="2"/>
        <geom size=".01" pos=".02 0 0" mass=".02"/>
        <body name="middle" pos=".04 0 0"><joint name="J2" axis="0 1 0" damping=".01"/>
          <geom size=".01" pos=".01 0 0" mass=".01"/>
          <body name="tip" pos=".03 0 0"><joint name="J1" axis="0 1 0" damping=".01"/>
            <geom size=".01" pos=".01 0 0" mass=".01"/></body></body></body></body>
  </worldbody>
  <tendon><fixed name="J0"><joint joint="J2" coef="1"/><joint joint="J1" coef="1"/></fixed></tendon>
  <actuator><position name="servo" tendon="J0" kp="1"/></actuator>
</mujoco>)";
}

void ExpectAll(const std::string& text, std::initializer_list<const char*> parts) {
  for (const char* part : parts) EXPECT_NE(text.find(part), std::string::npos) << part << " in\n" << text;
}

TEST(FreeMotion, ReduceRefusesAComplianceWithoutBound) {
  const std::string model = Write("coupled.xml", CoupledFinger());
  const Outcome json = Fork1s("reduce --json " + model);
  ASSERT_EQ(json.code, 0) << json.err;
  const auto d = json.Json();
  ASSERT_EQ(d["free_motions"].size(), 1u);
  const auto& motion = d["free_motions"][0];
  EXPECT_EQ(motion["body"], "tip");
  EXPECT_EQ(motion["joints"].size(), 2u);
  EXPECT_EQ(motion["motion_world"].size(), 6u);
  EXPECT_EQ(d["coordinates"]["free"], 1);
  EXPECT_TRUE(d["compliance_world"].is_null());
  EXPECT_TRUE(d["compliance_locked"].empty());
  EXPECT_TRUE(d["stiffness_world"].is_null());
  const Outcome text = Fork1s("reduce " + model);
  ExpectAll(text.out, {"free of springs (1)", "no bound", "--lock-free", "body 'tip'", "'J1'", "'J2'",
                       "tendon", "J2=KP,KV"});
  EXPECT_EQ(text.out.find("m/N; of the springs alone"), std::string::npos) << text.out;
  // Gravity is in the plane of the finger: about the equilibrium its weight resists that motion.
  EXPECT_EQ(d["loaded"]["frequencies_hz"].size(), 3u);
  EXPECT_FALSE(d["loaded"]["compliance_world"].is_null());
  // With one of the two locked the knuckle and the servo turn the tip: 1/2 and 1/1 rad/(N m).
  const auto locked = Fork1s("reduce --json --lock-free " + model).Json();
  EXPECT_NEAR(locked["compliance_world"][1][1].get<double>(), 1.5, 1e-12);
  ASSERT_EQ(locked["compliance_locked"].size(), 1u);
  const std::string joint = locked["compliance_locked"][0];
  const Outcome said = Fork1s("reduce --lock-free " + model);
  EXPECT_NE(said.out.find("'" + joint + "' locked"), std::string::npos) << said.out;
  // Statics answers alike: compliance times load.
  const std::string load = "statics --json --body tip --force 0,0,0.01 --gravity 0,0,0 ";
  const Outcome falls = Fork1s(load + model);
  EXPECT_EQ(falls.code, 3) << falls.out;
  ExpectAll(falls.err, {"joint 'J", "lock it"});
  const auto stays = Fork1s(load + "--lock-free " + model).Json();
  EXPECT_EQ(stays["locked"], locked["compliance_locked"]);
  const double moved =
      stays["linear"]["position_m"][2].get<double>() - stays["reference_position_m"][2].get<double>();
  EXPECT_NEAR(moved, 0.01 * locked["compliance_world"][5][5].get<double>(), 1e-12);
  // What it advises holds.
  const Outcome held = Fork1s("reduce --json --pd J1=1,0.01 " + model);
  ASSERT_EQ(held.code, 0) << held.err;
  EXPECT_TRUE(held.Json()["free_motions"].empty());
}

TEST(FreeMotion, InspectDoesNotCallItHeld) {
  const Outcome text = Fork1s("inspect " + Write("coupled.xml", CoupledFinger()));
  ASSERT_EQ(text.code, 0) << text.err;
  ExpectAll(text.out, {"Motions without stiffness (1)", "'J1'", "'J2'", "J2=KP,KV"});
}

TEST(FreeMotion, ATieRodThatSpinsUnseenIsRefused) {
  // Upright on a sprung king pin, steered by a rod with a passive ball at either end.
  const std::string model = Write("tie_rod.xml", R"(<mujoco model="steering">
  <compiler angle="radian"/>
  <custom><text name="fork1s_interface" data="upright"/></custom>
  <worldbody>
    <body name="rack"><geom size=".02" mass="1"/>
      <body name="rod" pos="0 .2 .05"><joint name="inner" type="ball"/>
        <geom type="capsule" fromto="0 0 0 .1 .25 -.02" size=".01" mass=".3"/></body>
      <body name="upright" pos="0 .5 0"><joint name="king_pin" axis=".1 0 1" stiffness="50"/>
        <geom size=".03" mass="2" pos=".02 0 0"/></body>
    </body>
  </worldbody>
  <equality><connect name="outer" body1="rod" body2="upright" anchor=".1 .25 -.02"/></equality>
</mujoco>)");
  for (const char* command : {"reduce ", "run --time 0.1 "}) {
    const Outcome o = Fork1s(command + model);
    EXPECT_EQ(o.code, 3) << o.out;
    ExpectAll(o.err, {"tie_rod.xml", "joint 'inner'", "turning about", "body 'rod' an interface"});
  }
  // Made an interface, it is a free motion like any other.
  const Outcome seen = Fork1s("reduce --json --interface upright,rod " + model);
  ASSERT_EQ(seen.code, 0) << seen.err;
  ASSERT_EQ(seen.Json()["free_motions"].size(), 1u);
  EXPECT_EQ(seen.Json()["free_motions"][0]["body"], "rod");
}

}  // namespace
}  // namespace fork1s::test
