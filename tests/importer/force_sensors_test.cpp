// Sensors of accelerations and forces against closed forms and, at rest, MuJoCo.
#include <fork1s/sim/continue.hpp>
#include <fork1s/sim/linearize.hpp>
#include <fork1s/sim/scene_factors.hpp>
#include <fork1s/sim/sensors.hpp>

#include "helpers.hpp"

namespace fork1s::testing_importer::force_sensors {
namespace {

constexpr double kG = 9.81;

Simulation MustStart(const std::string& mjcf, double dt = 1.0 / 240, const VectorX& q = {},
                     const VectorX& q_dot = {}) {
  ImportedScene loaded = MustLoad(mjcf);
  for (const ImportNote& note : loaded.report.notes)
    EXPECT_EQ(note.where.find("sensor"), std::string::npos) << note.Text();
  SimulationOptions options;
  options.dt = dt;
  if (q.size() > 0) {
    KeyframeDef key;
    key.mechanisms.resize(1);
    key.mechanisms[0].q = q;
    key.mechanisms[0].q_dot = q_dot;
    key.mechanisms[0].X_WR = loaded.scene.mechanisms[0].X_WR;
    key.mechanisms[0].controls =
        VectorX::Zero(static_cast<Eigen::Index>(loaded.scene.mechanisms[0].controls.size()));
    loaded.scene.keyframes = {key};
    options.initial_keyframe = 0;
  }
  auto simulation = Simulation::Create(loaded.scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

Vector3 At(const Sensors& sensors, const std::string& name) {
  const std::span<const double> v = sensors[name];
  return {v[0], v[1], v[2]};
}

// A moment that is gone back to has the means over the step before it, also after a linearisation, which makes steps.
TEST(ForceSensors, OfAMomentGoneBackTo_AreAsThen) {
  Simulation simulation = MustStart(R"(<mujoco><worldbody><body name="a" pos="0 0 .5">
    <joint name="j" axis="0 1 0" damping=".01"/><geom size=".05" mass="2" pos=".3 0 0"/><site name="s" pos=".3 0 0"/>
    </body></worldbody><sensor><accelerometer name="acc" site="s"/><force name="f" site="s"/></sensor></mujoco>)");
  for (int i = 0; i < 20; ++i) simulation.Step();
  Sensors sensors(simulation);
  const VectorX then = sensors.values();
  EXPECT_TRUE(then.allFinite());
  const Simulation::Snapshot snapshot = simulation.Save();
  ASSERT_TRUE(Linearize(simulation));
  sensors.Update(simulation);
  EXPECT_EQ(sensors.values(), then);
  for (int i = 0; i < 20; ++i) simulation.Step();
  ASSERT_TRUE(simulation.Restore(snapshot));
  sensors.Update(simulation);
  EXPECT_EQ(sensors.values(), then);
}

// An arm that comes to rest on stiff springs: what every cut carries, the tip's accelerometer, in turned sites. A
// plate is welded to the last link, and its cut is between bodies without a joint.
TEST(ForceSensors, OfAnArmAtRest_AreMujocosAndItsWeight) {
  const std::string text = R"(<mujoco><worldbody><body name="a" pos="0 0 .5" euler="0 20 0">
    <joint name="ja" axis="0 1 .2" stiffness="400" damping="30"/><geom type="box" size=".02 .03 .05" mass="1.2" pos=".02 .01 0"/>
    <site name="base" pos=".05 .03 .02" euler="-30 10 50"/>
    <body name="b" pos=".2 0 0" euler="30 0 0"><joint name="jb" axis="0 1 0" stiffness="300" damping="20"/>
      <geom size=".05" mass=".7"/><site name="wrist" pos="0 .01 .04" euler="80 20 10"/>
      <body name="plate" pos=".1 .05 0" euler="40 0 10"><geom size=".02" mass=".3" pos="0 0 .1"/>
        <site name="flange" euler="0 90 20"/></body></body></body></worldbody>
    <sensor><force name="f_base" site="base"/><torque name="t_base" site="base"/><force name="f_wrist" site="wrist"/>
    <torque name="t_wrist" site="wrist"/><force name="f_flange" site="flange"/><torque name="t_flange" site="flange"/>
    <accelerometer name="acc" site="flange"/><framelinacc name="lin" objtype="body" objname="b"/>
    <frameangacc name="ang" objtype="body" objname="b"/></sensor></mujoco>)";
  Simulation simulation = MustStart(text, 1.0 / 60);
  Sensors sensors(simulation);
  for (const double value : sensors.values()) EXPECT_TRUE(std::isnan(value));  // before the first step
  for (int i = 0; i < 600; ++i) simulation.Step();
  sensors.Update(simulation);
  EXPECT_NEAR(At(sensors, "f_base").norm(), 2.2 * kG, 1e-8);
  EXPECT_NEAR(At(sensors, "f_flange").norm(), 0.3 * kG, 1e-8);
  Peer peer(text);
  for (const auto& joint : simulation.given_mechanism(0).joints())
    peer.d->qpos[peer.Dof(joint.name)] = simulation.JointCoordinates(0)(joint.offset);
  mj_forward(peer.m.get(), peer.d.get());
  // MuJoCo's springs are the same, so that its accelerations vanish with ours.
  ASSERT_EQ(sensors.values().size(), peer.m->nsensordata);
  for (int k = 0; k < peer.m->nsensordata; ++k)
    EXPECT_NEAR(sensors.values()(k), peer.d->sensordata[k], 1e-7) << k;
}

// A pendulum of a point mass at l passes its lowest place at v: tension m (g + v²/l), acceleration upwards g + v²/l.
TEST(ForceSensors, OfAPendulumAtItsLowestPlace_HaveTheCentripetalForce) {
  const double l = 0.5, m = 0.8, rate = 3, h = 1e-4;
  const std::string text = R"(<mujoco><worldbody><body name="bob"><joint name="j" axis="0 1 0"/>
    <inertial pos="0 0 -.5" mass=".8" diaginertia="1e-9 1e-9 1e-9"/><geom size=".01" mass="0"/><site name="pivot"/><site name="end" pos="0 0 -.5"/></body></worldbody>
    <sensor><force name="f" site="pivot"/><torque name="t" site="pivot"/><accelerometer name="a" site="end"/>
    <gyro name="w" site="end"/></sensor></mujoco>)";
  Simulation simulation = MustStart(text, h, VectorX::Zero(1), VectorX::Constant(1, rate));
  Sensors sensors(simulation);
  simulation.Step();
  sensors.Update(simulation);
  // The mean over a step is that half way, up to (rate h)².
  const double up = kG + rate * rate * l;
  EXPECT_NEAR(At(sensors, "a").z(), up, 1e-5);
  EXPECT_NEAR(At(sensors, "f").z(), m * up, 1e-5);
  EXPECT_NEAR(At(sensors, "w").y(), rate, 1e-3);
  // No torque about the axis of the pivot; across it nothing either, by symmetry.
  EXPECT_LT(At(sensors, "t").norm(), 1e-6);
}

// A free body in the air feels nothing; one that is pushed feels the push and not its weight.
TEST(ForceSensors, OfAFreeBody_FeelWhatIsNotGravity) {
  Simulation simulation = MustStart(R"(<mujoco><worldbody><body name="b" pos="0 0 5"><freejoint/>
    <geom size=".1" mass="2"/><site name="s" euler="0 90 0"/></body></worldbody>
    <sensor><accelerometer name="a" site="s"/><force name="f" site="s"/></sensor></mujoco>)");
  Sensors sensors(simulation);
  simulation.Step();
  sensors.Update(simulation);
  EXPECT_LT(At(sensors, "a").norm(), 1e-9);
  simulation.ApplyWrench(0, Vector3(0, 6, 0), Vector3::Zero(), simulation.Pose(0).translation());
  simulation.Step();
  sensors.Update(simulation);
  EXPECT_LT((At(sensors, "a") - Vector3(0, 3, 0)).norm(), 1e-9);
  EXPECT_LT(At(sensors, "f").norm(), 1e-8);  // nothing carries it
}

// Boxes at rest on a plane: the sites under them bear their weight, one beside them nothing.
TEST(ForceSensors, OfTouch_BearTheWeightOfABox) {
  Simulation simulation = MustStart(R"(<mujoco><worldbody><geom type="plane" size="5 5 1"/>
    <body name="box" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="2"/>
      <site name="under" type="box" size=".12 .12 .02" pos="0 0 -.1"/><site name="half" type="box" size=".06 .12 .02" pos=".06 0 -.1"/>
      <site name="beside" type="sphere" size=".05" pos=".3 0 0"/><site name="round" type="ellipsoid" size=".2 .2 .03" pos="0 0 -.1"/>
      <site name="disc" type="cylinder" size=".2 .02" pos="0 0 -.1"/><site name="pill" type="capsule" size=".2 .02" pos="0 0 -.1"/></body></worldbody>
    <sensor><touch name="under" site="under"/><touch name="half" site="half"/><touch name="beside" site="beside"/>
    <touch name="round" site="round"/><touch name="disc" site="disc"/><touch name="pill" site="pill"/></sensor></mujoco>)");
  Sensors sensors(simulation);
  for (int i = 0; i < 480; ++i) simulation.Step();
  sensors.Update(simulation);
  for (const char* name : {"under", "round", "disc", "pill"})
    EXPECT_NEAR(sensors[name][0], 2 * kG, 1e-5) << name;
  EXPECT_NEAR(sensors["half"][0], kG, 1e-2);  // two of four corners
  EXPECT_EQ(sensors["beside"][0], 0);
}

// Forces of actuators are a function of state and input, so MuJoCo's at the same state are the same.
TEST(ForceSensors, OfActuators_AreMujocosAtTheSameState) {
  const std::string text =
      R"(<mujoco><worldbody><body name="a"><joint name="ja" axis="0 1 0" ref=".1" damping="1" actuatorfrcrange="-9 9"/>
      <geom size=".1" mass="1" pos=".1 0 0"/><body name="b" pos=".3 0 0"><joint name="jb" axis="0 1 0" damping="1"/><geom size=".1" mass="1" pos=".1 0 0"/></body></body></worldbody>
    <tendon><fixed name="t"><joint joint="ja" coef="2"/><joint joint="jb" coef="-1"/></fixed></tendon>
    <actuator><position name="p" joint="ja" kp="20" kv="2" gear="1.5"/><motor name="m" joint="jb" gear="3"/><motor name="mt" tendon="t" gear=".5"/>
      <velocity name="v" joint="jb" kv="4"/><position name="bounded" joint="jb" kp="50" forcerange="-.2 .3"/></actuator>
    <sensor><actuatorfrc actuator="p"/><actuatorfrc actuator="m"/><actuatorfrc actuator="mt"/><actuatorfrc actuator="v"/>
      <actuatorfrc actuator="bounded"/><jointactuatorfrc joint="ja"/><jointactuatorfrc joint="jb"/><tendonactuatorfrc tendon="t"/></sensor></mujoco>)";
  Simulation simulation = MustStart(text);
  Sensors sensors(simulation);
  const double u[] = {0.7, -0.4, 0.9, 0.5, -1.0};
  Peer peer(text);
  for (int k = 0; k < 5; ++k) {
    simulation.SetControl(mj_id2name(peer.m.get(), mjOBJ_ACTUATOR, k), u[k]);
    peer.d->ctrl[k] = u[k];
  }
  for (int step = 0; step < 20; ++step) {
    simulation.Step();
    sensors.Update(simulation);
    for (const auto& joint : simulation.given_mechanism(0).joints()) {
      const int dof = peer.Dof(joint.name);
      peer.d->qpos[dof] = peer.m->qpos0[dof] + simulation.JointCoordinates(0)(joint.offset);
      peer.d->qvel[dof] = simulation.JointRates(0)(joint.offset);
    }
    mj_forward(peer.m.get(), peer.d.get());
    for (int k = 0; k < peer.m->nsensordata; ++k)
      EXPECT_NEAR(sensors.values()(k), peer.d->sensordata[k], 1e-9) << k << ", step " << step;
  }
}

// Stiffness of servos by 4, of all or of one joint: gains by it, dampers by its root, inputs of motors and speeds as
// they were.
TEST(ForceSensors, OfActuatorsWithOtherStiffness_AreMujocosWithThatStiffness) {
  const std::string text =
      R"(<mujoco><worldbody><body name="a"><joint name="ja" axis="0 1 0" ref=".1" damping="1"/>
      <geom size=".1" mass="1" pos=".1 0 0"/><body name="b" pos=".3 0 0"><joint name="jb" axis="0 1 0" damping="1"/><geom size=".1" mass="1" pos=".1 0 0"/></body></body></worldbody>
    <tendon><fixed name="t"><joint joint="ja" coef="2"/><joint joint="jb" coef="-1"/></fixed></tendon>
    <actuator><position name="p" joint="ja" kp="20" kv="2" gear="1.5"/><motor name="m" joint="jb" gear="3"/><position name="pt" tendon="t" kp="5" gear=".5"/>
      <velocity name="v" joint="jb" kv="4"/></actuator>
    <sensor><actuatorfrc actuator="p"/><actuatorfrc actuator="m"/><actuatorfrc actuator="pt"/><actuatorfrc actuator="v"/>
      <jointactuatorfrc joint="ja"/><jointactuatorfrc joint="jb"/><tendonactuatorfrc tendon="t"/></sensor></mujoco>)";
  const double u[] = {0.7, -0.4, 0.9, 0.5};
  for (const std::string one : {"", "ja", "pt"}) {
    ImportedScene loaded = MustLoad(text);
    Peer peer(text);
    std::vector<int> scaled = {0};
    if (!one.empty()) {
      auto changed = WithStiffness(loaded.scene, one, one == "ja" ? 4 * 20 * 1.5 * 1.5 : 4 * 5);
      ASSERT_TRUE(changed) << changed.error().Text();
      loaded.scene = *changed;
      if (one == "pt") scaled = {2};
    } else {
      loaded.scene = Vary(loaded.scene, {.stiffness = 4});
      scaled = {0, 2, 3};
    }
    for (const int i : scaled) {
      if (i != 3) peer.m->actuator_gainprm[mjNGAIN * i] *= 4;
      peer.m->actuator_biasprm[mjNBIAS * i + 1] *= 4;
      peer.m->actuator_biasprm[mjNBIAS * i + 2] *= 2;
    }
    SimulationOptions options;
    options.dt = 1.0 / 240;
    auto simulation = Simulation::Create(loaded.scene, options);
    ASSERT_TRUE(simulation) << simulation.error().Text();
    Sensors sensors(*simulation);
    for (int k = 0; k < 4; ++k) {
      simulation->SetControl(mj_id2name(peer.m.get(), mjOBJ_ACTUATOR, k), u[k]);
      peer.d->ctrl[k] = u[k];
    }
    for (int step = 0; step < 5; ++step) {
      simulation->Step();
      sensors.Update(*simulation);
      for (const auto& joint : simulation->given_mechanism(0).joints()) {
        const int dof = peer.Dof(joint.name);
        peer.d->qpos[dof] = peer.m->qpos0[dof] + simulation->JointCoordinates(0)(joint.offset);
        peer.d->qvel[dof] = simulation->JointRates(0)(joint.offset);
      }
      mj_forward(peer.m.get(), peer.d.get());
      for (int k = 0; k < peer.m->nsensordata; ++k)
        EXPECT_NEAR(sensors.values()(k), peer.d->sensordata[k], 1e-9)
            << k << ", step " << step << ", of " << one;
    }
  }
}

// Proportional-derivative control takes the place of motors, whose law then is none of the simulation's.
TEST(ForceSensors, OfMotorsReplacedByPd_AreNanWithAReason) {
  ImportOptions options;
  options.pd = PdGains{10, 1};
  const ImportedScene loaded = MustLoad(R"(<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0"/>
      <geom size=".1" mass="1" pos=".1 0 0"/></body></worldbody><actuator><motor name="m" joint="j"/></actuator>
    <sensor><actuatorfrc name="f" actuator="m"/><jointactuatorfrc name="fj" joint="j"/><jointpos name="q" joint="j"/></sensor></mujoco>)",
                                        options);
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped,
                      "its actuator is not simulated as the file has it; its value is NaN"));
  auto simulation = Simulation::Create(loaded.scene);
  ASSERT_TRUE(simulation);
  for (int i = 0; i < 10; ++i) simulation->Step();
  const Sensors sensors(*simulation);
  EXPECT_TRUE(std::isnan(sensors["f"][0]));
  EXPECT_TRUE(std::isnan(sensors["fj"][0]));
  EXPECT_NE(sensors["q"][0], 0);
}

// Weights that hang from ropes: one through space, one over a joint at half of its way. MuJoCo comes to the same.
TEST(ForceSensors, OfTendonLimits_BearWhatHangsOnThem) {
  const std::string text = R"(<mujoco><worldbody><site name="hook"/>
    <body name="a" pos="0 0 -.3"><joint name="za" type="slide" axis="0 0 1" damping="20"/><geom size=".05" mass="2"/><site name="s"/></body>
    <body name="b" pos="1 0 0"><joint name="zb" type="slide" axis="0 0 1" damping="20" range="-9 9"/><geom size=".05" mass=".5"/></body></worldbody>
    <tendon><fixed name="half" limited="true" range="-.1 1"><joint joint="zb" coef="2"/></fixed>
    <spatial name="rope" limited="true" range="0 .5"><site site="hook"/><site site="s"/></spatial></tendon>
    <sensor><tendonlimitfrc name="rope" tendon="rope"/><tendonlimitfrc name="half" tendon="half"/>
    <jointlimitfrc name="zb" joint="zb"/></sensor></mujoco>)";
  Simulation simulation = MustStart(text);
  Sensors sensors(simulation);
  for (int i = 0; i < 720; ++i) simulation.Step();
  sensors.Update(simulation);
  EXPECT_NEAR(sensors["rope"][0], 2 * kG, 1e-6);
  EXPECT_NEAR(sensors["half"][0], 0.5 * kG / 2, 1e-6);
  EXPECT_EQ(sensors["zb"][0], 0);  // the limit of its own is far
  Peer peer(text);
  for (int i = 0; i < 5000; ++i) mj_step(peer.m.get(), peer.d.get());
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(sensors.values()(k), peer.d->sensordata[k], 1e-5) << k;
}

// A weight of 0.5 kg at 0.2 m that rests on a stop.
TEST(ForceSensors, OfALimit_BearTheWeightOnIt) {
  Simulation simulation =
      MustStart(R"(<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0" range="-60 0" damping=".5"/>
      <geom size=".02" mass=".5" pos=".2 0 0"/></body></worldbody>
    <sensor><jointlimitfrc name="f" joint="j"/></sensor></mujoco>)");
  Sensors sensors(simulation);
  for (int i = 0; i < 240; ++i) simulation.Step();
  sensors.Update(simulation);
  EXPECT_NEAR(sensors["f"][0], 0.5 * kG * 0.2, 1e-7);
}

TEST(ForceSensors, OverALoop_AreNanWithAReasonAndARemedy) {
  const std::string text = R"(<mujoco><worldbody>
    <body name="a"><joint name="ja" axis="0 1 0" damping="1"/><geom size=".02" mass="1"/><site name="s"/>
      <body name="b" pos=".3 0 0"><joint name="jb" axis="0 1 0" damping="1"/><geom size=".02" mass="1"/></body></body>
    </worldbody><equality><connect name="pin" body1="b" anchor=".1 0 .1"/></equality>
    <sensor><force name="f" site="s"/></sensor></mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  EXPECT_TRUE(
      HasNote(loaded.report, ImportNote::Kind::kDropped,
              "sensor 'f': 'pin' closes a loop over its body (the option switched=pin gives it a value); "
              "its value is NaN"));
  ImportOptions options;
  options.switched = {"pin"};
  SimulationOptions how;
  how.dt = 1.0 / 240;
  auto created = Simulation::Create(MustLoad(text, options).scene, how);
  ASSERT_TRUE(created) << created.error().Text();
  Simulation& simulation = *created;
  Sensors sensors(simulation);
  for (int i = 0; i < 240; ++i) simulation.Step();
  sensors.Update(simulation);
  // b hangs on a horizontal bar and one at 45 degrees, which pulls along x with the weight of b.
  EXPECT_LT((At(sensors, "f") - Vector3(-kG, 0, kG)).norm(), 1e-6);
}

}  // namespace
}  // namespace fork1s::testing_importer::force_sensors
