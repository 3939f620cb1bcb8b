// Values of sensors against MuJoCo's at the same state, and closed forms.
#include <fork1s/sim/sensors.hpp>

#include <algorithm>
#include <cmath>

#include "helpers.hpp"
#include "importer/model_copy.hpp"

namespace fork1s::testing_importer::sensors {
namespace {

// Sites turned in their bodies; nested bodies, some without joints; a camera, inertial frames, the world.
const std::string kArm = R"(<mujoco><compiler autolimits="true"/><option magnetic=".2 -.1 .4"/>
  <worldbody><site name="w" pos=".1 -.2 .3" euler="20 -40 70"/>
  <body name="stand" pos=".3 .1 0" euler="10 0 30"><site name="still" pos="0 .1 0" euler="5 5 5"/></body>
  <body name="a" pos="0 0 .5" euler="0 20 0"><joint name="ja" axis="0 1 .2" ref=".2" stiffness="5" damping=".01"/>
    <joint name="sa" type="slide" axis="1 0 0" stiffness="200" damping=".1"/>
    <geom name="ga" type="box" size=".02 .03 .05" pos=".02 .01 0" euler="30 0 0" contype="0" conaffinity="0"/>
    <site name="a1" pos=".05 .03 .02" euler="-30 10 50"/>
    <body name="b" pos=".2 0 0"><joint name="jb" type="ball" stiffness="3" damping=".01"/>
      <geom type="box" size=".05 .02 .01" pos=".05 0 0" contype="0" conaffinity="0"/>
      <site name="b1" pos=".06 .01 .04" euler="80 20 10"/>
      <body name="plate" pos=".02 .05 0" euler="40 0 10"><geom size=".02" contype="0" conaffinity="0"/>
        <site name="p1" pos="0 0 .1" euler="0 90 20"/><camera name="eye" pos=".1 0 0" euler="10 20 30"/></body>
      <body name="c" pos=".15 0 0"><joint name="jc" axis="1 1 0" range="-10 5" stiffness="1" damping=".01"/>
        <geom size=".02" contype="0" conaffinity="0"/><site name="c1" pos=".08 .02 .03" euler="10 -60 30"/></body>
    </body>
    <body name="e" pos="0 .2 0"><joint name="je" axis="0 0 1" stiffness="2" damping=".01"/>
      <geom size=".02" contype="0" conaffinity="0"/><site name="e1" pos=".04 0 .05" euler="0 70 20"/></body></body>
  %s</worldbody>
  <tendon><fixed name="sum"><joint joint="ja" coef="2"/><joint joint="je" coef="-.5"/></fixed>
    <spatial name="rope"><site site="w"/><site site="b1"/><site site="c1"/></spatial></tendon>
  <actuator><position name="pa" joint="ja" kp="2" gear="3"/><motor name="mt" tendon="sum" gear="-2"/>
    <motor name="mr" tendon="rope"/><general name="mb" joint="jb" gear="1 2 3"/><motor name="ms" site="c1" refsite="a1" gear="1 0 2 0 .4 1"/>
  </actuator>
  <sensor><jointpos name="p_ja" joint="ja"/><jointpos joint="sa"/><jointpos joint="je" cutoff=".01"/><jointvel joint="ja"/><jointvel joint="jc"/>
    <tendonpos tendon="sum"/><tendonvel tendon="sum"/><tendonpos tendon="rope"/><tendonvel tendon="rope"/>
    <actuatorpos actuator="pa"/><actuatorvel actuator="pa"/><actuatorpos actuator="mt"/><actuatorvel actuator="mt"/>
    <actuatorpos actuator="mr"/><actuatorvel actuator="mr"/><actuatorvel actuator="ms"/><actuatorvel actuator="mb"/>
    <ballquat joint="jb"/><ballangvel joint="jb"/>%s
    <velocimeter site="c1"/><velocimeter site="p1" cutoff=".02"/><gyro site="b1"/><gyro site="p1"/>
    <magnetometer site="e1"/><magnetometer site="w"/><subtreecom body="a"/><subtreelinvel body="a"/><subtreeangmom body="a"/>
    <subtreecom body="b"/><subtreelinvel body="b"/><subtreeangmom body="b"/><subtreeangmom body="plate"/>
    <e_kinetic/><clock/></sensor>
</mujoco>)";

// Every kind of frame sensor of several objects, each relative to several frames.
std::string FrameSensors(const std::vector<std::string>& objects,
                         const std::vector<std::string>& references) {
  std::string text;
  for (const std::string kind :
       {"framepos", "framequat", "framexaxis", "frameyaxis", "framezaxis", "framelinvel", "frameangvel"}) {
    for (const std::string& object : objects) {
      text += '<' + kind + ' ' + object + "/>";
      for (const std::string& reference : references)
        text += '<' + kind + ' ' + object + ' ' + reference + "/>";
    }
  }
  return text;
}

std::string Replaced(std::string text, const std::string& bodies, const std::string& sensors) {
  text.replace(text.find("%s"), 2, bodies);
  return text.replace(text.find("%s"), 2, sensors);
}

Simulation MustStart(const Scene& scene, const SimulationOptions& options = {}) {
  auto simulation = Simulation::Create(scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

// Random joint displacements and rates, poses and velocities of what floats or flies.
KeyframeDef RandomState(const Scene& scene, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&](Eigen::Index n, double size) {
    return VectorX(VectorX::NullaryExpr(n, [&](Eigen::Index) { return size * uniform(random); }));
  };
  KeyframeDef key;
  for (const MechanismDef& def : scene.mechanisms) {
    const Mechanism m = MustBuild(def);
    KeyframeDef::MechanismState s;
    s.q = vector(m.num_coordinates(), 0.4);
    s.q_dot = vector(m.num_coordinates(), 1);
    s.X_WR = def.X_WR;
    if (def.base == BaseKind::kFloating) {
      s.X_WR = RigidTransform(Matrix3(ExpRotation(vector(3, 2))), Vector3(vector(3, 1)));
      s.V_R = vector(6, 1);
    }
    s.controls = VectorX::Zero(static_cast<Eigen::Index>(def.controls.size()));
    key.mechanisms.push_back(std::move(s));
  }
  for (std::size_t f = 0; f < scene.free_bodies.size(); ++f)
    key.free_bodies.push_back({RigidTransform(Matrix3(ExpRotation(vector(3, 2))), Vector3(vector(3, 1))),
                               Vector3(vector(3, 1)), Vector3(vector(3, 1))});
  return key;
}

// Steps from random states; where each ends, MuJoCo's mj_forward gives the same values.
void ExpectMujocosValues(const std::string& mjcf) {
  const std::string path = WriteFile("sensors.xml", mjcf);
  for (unsigned seed = 1; seed <= 5; ++seed) {
    auto loaded = LoadMechanism(path);
    ASSERT_TRUE(loaded) << loaded.error().Text();
    Scene& scene = loaded->scene;
    for (const ImportNote& note : loaded->report.notes)
      EXPECT_EQ(note.where.find("sensor"), std::string::npos) << note.Text();
    scene.keyframes = {RandomState(scene, seed)};
    SimulationOptions options;
    options.initial_keyframe = 0;
    options.dt = 1.0 / 240;
    Simulation simulation = MustStart(scene, options);
    Sensors sensors(simulation);
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(simulation.Step().finite);
    sensors.Update(simulation);

    const auto key = MomentAsMjcf(path, {}, simulation.State(), "now", simulation.time());
    ASSERT_TRUE(key) << key.error().Text();
    std::string text = mjcf;
    text.insert(text.find("</mujoco>"), "<keyframe>" + *key + "</keyframe>");
    Peer peer(text);
    mjModel& m = *peer.m;
    mjData& d = *peer.d;
    m.opt.enableflags |= mjENBL_ENERGY;
    mj_resetDataKeyframe(&m, &d, 0);
    mj_forward(&m, &d);
    ASSERT_EQ(sensors.count(), m.nsensor);
    ASSERT_EQ(sensors.values().size(), m.nsensordata);
    for (int i = 0; i < m.nsensor; ++i) {
      SCOPED_TRACE("sensor " + std::to_string(i) + " of type " + std::to_string(m.sensor_type[i]) +
                   ", seed " + std::to_string(seed));
      const std::span<const double> ours = sensors[i];
      ASSERT_EQ(static_cast<int>(ours.size()), m.sensor_dim[i]);
      const mjtNum* theirs = d.sensordata + m.sensor_adr[i];
      // A quaternion and its opposite are one rotation.
      double sign = 1;
      if (m.sensor_type[i] == mjSENS_FRAMEQUAT || m.sensor_type[i] == mjSENS_BALLQUAT) {
        sign = 0;
        for (int k = 0; k < 4; ++k) sign += ours[static_cast<std::size_t>(k)] * theirs[k];
        sign = sign < 0 ? -1 : 1;
      }
      // The state comes to MuJoCo as decimals of 17 digits.
      for (std::size_t k = 0; k < ours.size(); ++k)
        EXPECT_NEAR(sign * ours[k], theirs[k], 1e-9 * std::max(1.0, std::abs(theirs[k]))) << k;
    }
  }
}

TEST(Sensors, OfAnArm_AreMujocosAtTheSameState) {
  const std::string frames =
      FrameSensors({R"(objtype="site" objname="c1")", R"(objtype="body" objname="b")",
                    R"(objtype="xbody" objname="plate")", R"(objtype="geom" objname="ga")",
                    R"(objtype="camera" objname="eye")", R"(objtype="site" objname="still")"},
                   {R"(reftype="site" refname="e1")", R"(reftype="body" refname="a")",
                    R"(reftype="site" refname="still")"});
  ExpectMujocosValues(Replaced(kArm, "", frames));
}

TEST(Sensors, OfFloatingAndFreeBodies_AreMujocosAtTheSameState) {
  const std::string bodies =
      R"(<body name="walker" pos="1 0 1"><freejoint/><geom type="box" size=".1 .05 .02" pos=".03 0 0"/>
      <site name="hip" pos=".1 0 0" euler="0 30 40"/>
      <body name="leg" pos=".1 0 0" euler="0 10 0"><joint name="knee" axis="0 1 0" stiffness="4" damping=".01"/>
        <geom size=".02" contype="0" conaffinity="0"/><site name="foot" pos="0 0 -.1" euler="45 0 0"/></body></body>
    <body name="brick" pos="2 0 1"><freejoint/><geom type="box" size=".1 .05 .02" pos=".03 .02 0"/>
      <body name="knob" pos=".1 0 .1" euler="50 0 0"><geom type="box" size=".02 .03 .01"/>
        <site name="top" pos="0 0 .02" euler="0 40 0"/></body></body>)";
  const std::string sensors =
      FrameSensors({R"(objtype="site" objname="foot")", R"(objtype="site" objname="top")",
                    R"(objtype="body" objname="walker")", R"(objtype="xbody" objname="brick")"},
                   {R"(reftype="site" refname="hip")", R"(reftype="site" refname="c1")",
                    R"(reftype="xbody" refname="knob")"}) +
      R"(<gyro site="hip"/><gyro site="top"/><velocimeter site="foot"/><velocimeter site="top"/><jointpos joint="knee"/>
        <subtreecom body="walker"/><subtreelinvel body="walker"/><subtreeangmom body="walker"/><subtreeangmom body="leg"/>
        <subtreecom body="brick"/><subtreelinvel body="brick"/><subtreeangmom body="brick"/><subtreecom body="world"/>
        <subtreelinvel body="world"/><subtreeangmom body="world"/>)";
  ExpectMujocosValues(Replaced(kArm, bodies, sensors));
}

TEST(Sensors, OfActuatorsOnFreeAndBallJoints_AreMujocosAtTheSameState) {
  ExpectMujocosValues(
      R"(<mujoco><worldbody><body name="drone" pos="0 0 1" euler="20 0 10"><freejoint name="f"/>
      <geom type="box" size=".1 .2 .05"/></body>
      <body name="arm" pos="1 0 1" euler="0 30 10"><joint name="b" type="ball"/><geom type="box" size=".1 .2 .05" pos=".2 0 0"/></body></worldbody>
    <actuator><velocity name="wrist" jointinparent="b" gear=".3 .5 -.2" kv=".1"/><velocity name="brake" joint="f" gear=".4 0 1 .3 .5 -.2" kv=".6"/>
      <velocity name="slow" jointinparent="f" gear="1 0 -2 .7 .4 -.3" kv=".2"/></actuator>
    <sensor><actuatorpos actuator="brake"/><actuatorvel actuator="brake"/><actuatorfrc actuator="brake"/>
      <actuatorpos actuator="slow"/><actuatorvel actuator="slow"/><actuatorfrc actuator="slow"/>
      <actuatorpos actuator="wrist"/><actuatorvel actuator="wrist"/><actuatorfrc actuator="wrist"/></sensor></mujoco>)");
}

// Rays from sites of moving and still bodies among shapes of all kinds, some without an end; volumes; weight and
// springs, one of them with higher terms and slack.
TEST(Sensors, OfRaysVolumesAndPotentialEnergy_AreMujocosAtTheSameState) {
  const std::string bodies =
      R"(<geom type="plane" size="0 0 1" pos="0 0 -1"/><geom type="sphere" size=".2" pos="-1 .3 .5"/>
    <geom type="box" size=".1 2 2" pos="1.5 0 0" euler="0 10 20"/><geom type="ellipsoid" size=".5 .3 .4" pos="0 -1.2 .5"/>
    <site name="volume" type="box" size=".3 .2 .2" pos=".2 .05 .4" euler="10 20 30"/>
    <site name="ball" type="sphere" size=".25" pos="0 0 .5"/><site name="pill" type="capsule" size=".1 .3" pos=".2 0 .4"/>
    <body name="pole" pos=".5 .8 .3" euler="20 0 0"><geom type="capsule" size=".1 .5" mass="3"/><site name="in" euler="70 0 0"/></body>
    <body name="brick" pos="2 0 1"><freejoint/><geom type="box" size=".3 .2 .2" pos=".03 .02 0"/>
      <body name="knob" pos=".1 0 .4" euler="50 0 0"><geom type="cylinder" size=".3 .3"/><site name="top" euler="0 140 0"/></body></body>)";
  std::string sensors;
  for (const char* site : {"c1", "p1", "b1", "a1", "e1", "w", "in", "still", "top"}) {
    sensors +=
        "<rangefinder site='" + std::string(site) + "'/><rangefinder cutoff='.4' site='" + site + "'/>";
    for (const char* volume : {"volume", "ball", "pill"})
      sensors += "<insidesite site='" + std::string(volume) + "' objtype='site' objname='" + site + "'/>";
  }
  sensors += "<insidesite site='ball' objtype='body' objname='b'/><e_potential/>";
  std::string text = Replaced(kArm, bodies, sensors);
  text.replace(text.find("<spatial name=\"rope\">"), 21,
               R"(<spatial name="rope" stiffness="8 2 3" springlength=".3 .5" damping=".1">)");
  ExpectMujocosValues(text);
}

// Exceeded limits: -0.1 rad below the lower, 0.05 rad above the upper; soft ones of MuJoCo's do not move the state.
TEST(Sensors, OfLimits_AreDistanceAndRateBeyondThem) {
  const std::string text = R"(<mujoco><compiler angle="radian"/><worldbody><body>
      <joint name="j" axis="0 1 0" limited="true" range="-.3 .2"/><geom size=".1"/></body></worldbody>
    <sensor><jointlimitpos name="p" joint="j"/><jointlimitvel name="v" joint="j"/></sensor></mujoco>)";
  for (const double q : {-0.4, 0.25, 0.1}) {
    ImportedScene loaded = MustLoad(text);
    KeyframeDef key;
    key.mechanisms.resize(1);
    key.mechanisms[0].q = VectorX::Constant(1, q);
    key.mechanisms[0].q_dot = VectorX::Constant(1, 0.7);
    key.mechanisms[0].controls.resize(0);
    loaded.scene.keyframes = {key};
    SimulationOptions options;
    options.initial_keyframe = 0;
    const Simulation simulation = MustStart(loaded.scene, options);
    const Sensors sensors(simulation);
    Peer peer(text);
    peer.d->qpos[0] = q;
    peer.d->qvel[0] = 0.7;
    mj_forward(peer.m.get(), peer.d.get());
    EXPECT_NEAR(sensors["p"][0], peer.d->sensordata[0], 1e-14);
    EXPECT_NEAR(sensors["v"][0], peer.d->sensordata[1], 1e-14);
  }
}

TEST(Sensors, WithoutAValue_AreNanWithAReason) {
  const ImportedScene loaded = MustLoad(R"(<mujoco><worldbody>
      <body name="b"><joint name="j" axis="0 1 0"/><geom size=".1"/><site name="s"/></body><camera name="eye" resolution="10 10"/></worldbody>
    <sensor><user name="own" dim="3"/><camprojection name="seen" site="s" camera="eye"/><jointpos name="angle" joint="j" noise=".1"/></sensor></mujoco>)");
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped,
                      "sensor 'own': a program of the user computes it; its value is NaN"));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "sensor 'seen'"));
  EXPECT_TRUE(
      HasNote(loaded.report, ImportNote::Kind::kDropped, "noise of sensor 'angle': values are exact"));
  const Simulation simulation = MustStart(loaded.scene);
  const Sensors sensors(simulation);
  ASSERT_EQ(sensors["own"].size(), 3u);
  for (const double value : sensors["own"]) EXPECT_TRUE(std::isnan(value));
  EXPECT_EQ(sensors["angle"][0], 0);
  EXPECT_EQ(sensors.definition(0).reason, "a program of the user computes it");
}

TEST(Sensors, UnknownNames_AreRefusedWithTheNearest) {
  const ImportedScene loaded = MustLoad(R"(<mujoco><worldbody>
      <body name="b"><joint name="j" axis="0 1 0"/><geom size=".1"/></body></worldbody>
    <sensor><jointpos name="angle" joint="j"/><jointvel name="rate" joint="j"/></sensor></mujoco>)");
  const Simulation simulation = MustStart(loaded.scene);
  const Sensors sensors(simulation);
  try {
    static_cast<void>(sensors["angel"]);
    FAIL();
  } catch (const std::invalid_argument& e) {
    EXPECT_CONTAINS(e.what(), "there is no sensor 'angel'");
    EXPECT_CONTAINS(e.what(), "'angle'");
  }
  EXPECT_THROW(static_cast<void>(sensors[2]), std::invalid_argument);
}

}  // namespace
}  // namespace fork1s::testing_importer::sensors
