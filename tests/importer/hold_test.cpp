// The option hold: set-points of position servos where the joints start.
#include <cmath>

#include "helpers.hpp"

namespace fork1s::testing_importer {
namespace {

using Kind = ImportNote::Kind;
constexpr double kForceRounding = 1e-10;  // N or N·m of servos of some 100 N·m/rad

// Servos of all kinds, and a motor and a velocity servo, which hold no place.
constexpr const char* kServoArm = R"(<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/>
  <worldbody><site name="post" pos="0 .3 1"/>
  <body name="upper" pos="0 0 1"><joint name="lift" axis="0 1 0" ref=".2" range="-2 2"/>
    <geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/><site name="hook" pos=".2 .05 0"/>
    <body name="fore" pos=".3 0 0"><joint name="elbow" axis="0 1 0"/>
      <geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/>
      <body name="hand" pos=".3 0 0"><joint name="wrist" axis="1 0 0"/><geom size=".03"/>
        <body name="left" pos=".05 0 0"><joint name="left" type="slide" axis="0 1 0"/><geom size=".01"/></body>
        <body name="right" pos=".05 0 0"><joint name="right" type="slide" axis="0 -1 0"/><geom size=".01"/></body>
  </body></body></body></worldbody>
  <tendon><fixed name="split"><joint joint="left" coef=".5"/><joint joint="right" coef=".5"/></fixed>
    <spatial name="cable"><site site="post"/><site site="hook"/></spatial></tendon>
  <actuator><position name="lift" joint="lift" kp="300" kv="5"/>
    <general name="elbow" joint="elbow" gear="2" gainprm="100" biastype="affine" biasprm="3 -50 -1"/>
    <intvelocity name="wrist" joint="wrist" kp="20" actrange="-3 3"/>
    <position name="fingers" tendon="split" kp="500" timeconst=".1"/>
    <position name="cable" tendon="cable" kp="40" inheritrange="0"/>
    <motor name="help" joint="lift" ctrlrange="-9 9"/><velocity name="brake" joint="elbow" kv="2"/></actuator>
  <keyframe><key name="home" qpos=".9 -1.1 .4 .02 .01" ctrl="0 .1 .2 .3 .4 .5 .6" act=".7 .8"/>
    <key name="away" qpos="-.5 .3 1 0 .03" ctrl="0 0 0 0 0 .25 0"/></keyframe></mujoco>)";

// The file in MuJoCo, at the positions of a keyframe and with the controls and activations of ours.
Peer PeerAt(const ImportedScene& loaded, const KeyframeDef& state, const char* key) {
  Peer peer(kServoArm);
  mjModel& m = *peer.m;
  mjData& d = *peer.d;
  mj_resetData(&m, &d);
  if (key != nullptr)
    mju_copy(d.qpos, m.key_qpos + mj_name2id(&m, mjOBJ_KEY, key) * m.nq, static_cast<int>(m.nq));
  const auto& controls = loaded.scene.mechanisms[0].controls;
  for (std::size_t k = 0; k < controls.size(); ++k) {
    const int actuator = mj_name2id(&m, mjOBJ_ACTUATOR, controls[k].name.c_str());
    const auto i = static_cast<Eigen::Index>(k);
    d.ctrl[actuator] = state.mechanisms[0].controls[i];
    if (m.actuator_actadr[actuator] >= 0)
      d.act[m.actuator_actadr[actuator]] = state.mechanisms[0].activation[i];
  }
  mj_forward(&m, &d);
  return peer;
}

double ForceOf(const Peer& peer, const char* actuator) {
  return peer.d->actuator_force[mj_name2id(peer.m.get(), mjOBJ_ACTUATOR, actuator)];
}

void ExpectHeld(const ImportedScene& loaded, const KeyframeDef& state, const char* key) {
  const Peer peer = PeerAt(loaded, state, key);
  for (const char* servo : {"lift", "elbow", "wrist", "fingers", "cable"})
    EXPECT_NEAR(ForceOf(peer, servo), 0, kForceRounding)
        << servo << " at " << (key != nullptr ? key : "reference");
}

const KeyframeDef& HeldStart(const ImportedScene& loaded) {
  if (loaded.initial_keyframe < 0) throw std::runtime_error("no keyframe is the initial one");
  return loaded.scene.keyframes[static_cast<std::size_t>(loaded.initial_keyframe)];
}

double ControlAt(const ImportedScene& loaded, const KeyframeDef& state, const std::string& name) {
  const auto& controls = loaded.scene.mechanisms[0].controls;
  for (std::size_t k = 0; k < controls.size(); ++k)
    if (controls[k].name == name) return state.mechanisms[0].controls[static_cast<Eigen::Index>(k)];
  throw std::runtime_error("no control " + name);
}

TEST(Hold, ServosHoldTheKeyframeOfTheStart_AsMuJoCoEvaluatesThem) {
  ImportOptions options;
  options.keyframe = "home";
  const ImportedScene plain = MustLoad(kServoArm, options);
  EXPECT_GT(std::abs(ForceOf(PeerAt(plain, HeldStart(plain), "home"), "lift")),
            100);  // 300 N·m/rad · 0.9 rad
  options.hold = true;
  const ImportedScene held = MustLoad(kServoArm, options);
  const KeyframeDef& start = HeldStart(held);
  EXPECT_EQ(start.name, "start");
  ExpectHeld(held, start, "home");
  EXPECT_NEAR(ControlAt(held, start, "lift"), .9, kForceRounding);
  EXPECT_NEAR(ControlAt(held, start, "elbow"), (-3 + 50 * 2 * -1.1) / 100, kForceRounding);
  EXPECT_EQ(ControlAt(held, start, "wrist"), 0);  // the rate of its set-point
  EXPECT_EQ(ControlAt(held, start, "help"), .5);
  EXPECT_EQ(ControlAt(held, start, "brake"), .6);
  for (const char* kept : {"'help'", "'brake'"}) {
    EXPECT_TRUE(HasNote(held.report, Kind::kChosen, kept)) << kept;
  }
  EXPECT_TRUE(HasNote(held.report, Kind::kChosen, "the option hold leaves"));
  EXPECT_FALSE(HasNote(held.report, Kind::kChosen, "'lift'"));
  for (const ControlDef& control : held.scene.mechanisms[0].controls)
    EXPECT_EQ(control.initial, ControlAt(held, start, control.name)) << control.name;
}

TEST(Hold, EveryKeyframeIsHeldAtItsOwnPose) {
  ImportOptions options;
  options.hold = true;
  const ImportedScene held = MustLoad(kServoArm, options);
  ExpectHeld(held, HeldStart(held), nullptr);
  EXPECT_NEAR(ControlAt(held, HeldStart(held), "lift"), .2, kForceRounding);  // its reference
  ExpectHeld(held, held.scene.keyframes[0], "home");
  ExpectHeld(held, held.scene.keyframes[1], "away");
  EXPECT_EQ(ControlAt(held, held.scene.keyframes[1], "help"), .25);
}

TEST(Hold, CoordinatesOfTheOptionsAreHeld) {
  ImportOptions options;
  options.hold = true;
  options.keyframe = "home";
  options.joint_coordinates = {{"lift", -.3}};
  const ImportedScene held = MustLoad(kServoArm, options);
  EXPECT_NEAR(ControlAt(held, HeldStart(held), "lift"), -.3, kForceRounding);
  EXPECT_NEAR(ControlAt(held, HeldStart(held), "elbow"), (-3 + 50 * 2 * -1.1) / 100, kForceRounding);
}

TEST(Hold, SetPointsBeyondTheirRange_AreNamed) {
  const auto arm = [](const std::string& actuator) {
    return R"(<mujoco><worldbody><body name="arm"><joint name="j" axis="0 1 0"/><geom size=".1" pos=".3 0 0"/></body>
      </worldbody><actuator>)" +
           actuator + "</actuator></mujoco>";
  };
  ImportOptions options;
  options.hold = true;
  options.joint_coordinates = {{"j", 1}};
  const ImportedScene bounded =
      MustLoad(arm(R"(<position name="a" joint="j" kp="50" ctrlrange="-.5 .5"/>)"), options);
  EXPECT_EQ(ControlAt(bounded, HeldStart(bounded), "a"), .5);
  EXPECT_TRUE(HasNote(bounded.report, Kind::kChanged, "'a': the set-point that holds the start is outside"));
  const ImportedScene motor = MustLoad(arm(R"(<motor name="a" joint="j"/>)"), options);
  EXPECT_TRUE(HasNote(motor.report, Kind::kChosen, "no position servo is there"));
  options.pd = PdGains{20, 1};
  const ImportedScene pd = MustLoad(arm(R"(<motor name="a" joint="j"/>)"), options);
  EXPECT_FALSE(HasNote(pd.report, Kind::kChosen, "no position servo is there"));
  EXPECT_EQ(HeldStart(pd).mechanisms[0].controls[0], 0);  // of --pd, from the start on
}

}  // namespace
}  // namespace fork1s::testing_importer
