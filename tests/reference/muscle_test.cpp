// Muscles: activation, force and motion against MuJoCo, both simulators against each other.
#include <mujoco/mujoco.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/sensors.hpp>
#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <fstream>
#include <memory>
#include <random>
#include <string>

#include "mechanism/activation.hpp"
#include "support.hpp"

namespace fork1s::reference_test::muscles {
namespace {

// Two links with six muscles on tendons that wrap round both joints, two of which pass both.
constexpr const char* kArm = R"(<mujoco><option gravity="0 0 0" timestep="2e-5" integrator="RK4"/>
  <default><muscle ctrllimited="true" ctrlrange="0 1"/><joint axis="0 0 1" limited="true" damping=".05"/>
    <geom contype="0" conaffinity="0"/></default>
  <worldbody><site name="root" pos="-.2 0 .01"/><site name="back" pos="0 -.2 0"/>
    <body name="upper"><joint name="shoulder" range="-20 130"/>
      <geom type="capsule" size=".03" fromto="0 0 0 .4 0 0" mass="1.7"/>
      <geom name="ball" type="sphere" size=".07" mass="0"/>
      <site name="u1" pos=".12 .05 0"/><site name="u2" pos=".12 -.05 0"/><site name="u3" pos=".3 .05 0"/>
      <site name="u4" pos=".3 -.05 0"/><site name="u5" pos=".2 .08 .01"/><site name="u6" pos=".2 -.08 0"/>
      <site name="behind" pos=".4 -.12 0"/>
      <body name="lower" pos=".4 0 0"><joint name="elbow" range="-10 140"/>
        <geom type="capsule" size=".025" fromto="0 0 0 .35 0 0" mass="1.1"/>
        <geom name="roll" type="cylinder" size=".05 .1" mass="0"/>
        <site name="l1" pos=".1 .04 0"/><site name="l2" pos=".1 -.04 0"/></body></body></worldbody>
  <tendon>
    <spatial name="SF"><site site="root"/><geom geom="ball"/><site site="u1"/></spatial>
    <spatial name="SE"><site site="root"/><geom geom="ball" sidesite="back"/><site site="u2"/></spatial>
    <spatial name="EF"><site site="u3"/><geom geom="roll"/><site site="l1"/></spatial>
    <spatial name="EE"><site site="u4"/><geom geom="roll" sidesite="behind"/><site site="l2"/></spatial>
    <spatial name="BF"><site site="root"/><geom geom="ball"/><site site="u5"/><geom geom="roll"/><site site="l1"/></spatial>
    <spatial name="BE"><site site="root"/><geom geom="ball" sidesite="back"/><site site="u6"/>
      <geom geom="roll" sidesite="behind"/><site site="l2"/></spatial></tendon>
  <actuator><muscle name="SF" tendon="SF"/><muscle name="SE" tendon="SE" force="150" lengthrange=".25 .45"/>
    <muscle name="EF" tendon="EF" scale="120" timeconst=".02 .06"/>
    <muscle name="EE" tendon="EE" range=".8 1.1" lmin=".4" lmax="1.7" vmax="2" fpmax="1.5" fvmax="1.4" lengthrange=".2 .29"/>
    <muscle name="BF" tendon="BF" tausmooth=".3"/><muscle name="BE" tendon="BE" gear="1.2" lengthrange=".55 .85"/></actuator>
  <keyframe><key name="k" qpos=".8 .9" qvel="1 -2" act=".1 .2 0 .4 .1 .3" ctrl=".1 .6 .2 .3 .7 .1"/></keyframe></mujoco>)";

// A muscle on a joint, on a fixed tendon, on a slider-crank and on a site, of given length ranges.
constexpr const char* kOthers = R"(<mujoco><option gravity="0 0 0"/>
  <worldbody><site name="hook" pos="0 .3 .4"/>
    <body name="a"><joint name="ja" axis="0 1 0" ref=".2"/><geom size=".05" pos=".2 0 0" mass="1"/>
    <site name="pin" pos=".2 .05 0"/><site name="eye" pos=".25 0 0"/>
      <body name="b" pos=".3 0 0"><joint name="jb" axis="0 0 1"/><geom size=".04" pos=".1 .1 0" mass=".5"/></body></body>
    <body name="slider" pos="0 0 -.4"><site name="crank" zaxis="0 0 1"/></body></worldbody>
  <tendon><fixed name="t"><joint joint="ja" coef=".05"/><joint joint="jb" coef="-.03"/></fixed></tendon>
  <actuator><muscle name="joint" joint="ja" gear=".04" lengthrange="-.04 .06" force="80"/>
    <muscle name="fixed" tendon="t" lengthrange="-.02 .02" force="60"/>
    <muscle name="crank" cranksite="pin" slidersite="crank" cranklength=".8" lengthrange="-.5 1.5" force="50"/>
    <general name="site" site="eye" refsite="hook" gear="1 .5 -.3 0 .1 0" lengthrange="-1 1" dyntype="filterexact"
      dynprm=".03" gaintype="muscle" biastype="none" gainprm=".7 1.1 40 200 .5 1.6 1.5 1.3 1.2"/></actuator></mujoco>)";

struct Model {
  std::unique_ptr<mjModel, void (*)(mjModel*)> mujoco{nullptr, mj_deleteModel};
  std::unique_ptr<mjData, void (*)(mjData*)> data{nullptr, mj_deleteData};
  ImportedScene imported;
};

Model Read(const std::string& text, const std::string& keyframe = "") {
  const auto path =
      std::filesystem::path(::testing::TempDir()) / ("fork1s_muscle_" + std::to_string(getpid()) + ".xml");
  std::ofstream(path) << text;
  char error[500] = "";
  Model out;
  out.mujoco.reset(mj_loadXML(path.c_str(), nullptr, error, 500));
  ImportOptions options;
  options.keyframe = keyframe;
  auto imported = LoadMechanism(path.string(), options);
  std::filesystem::remove(path);
  if (!out.mujoco) throw std::runtime_error(error);
  if (!imported) throw std::runtime_error(imported.error().Text());
  out.data.reset(mj_makeData(out.mujoco.get()));
  out.imported = std::move(*imported);
  for (const ImportNote& note : out.imported.report.notes)
    EXPECT_NE(note.kind, ImportNote::Kind::kDropped) << note.where << ": " << note.message;
  return out;
}

Simulation MustCreate(const Scene& scene, double h) {
  SimulationOptions options;
  options.dt = h;
  options.step.integrator = Integrator::kTwoStage;
  options.initial_keyframe = scene.keyframes.empty() ? -1 : 0;
  auto simulation = Simulation::Create(scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

TEST(MuscleActivation, IsMuJoCosInSmallSteps) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int trial = 0; trial < 200; ++trial) {
    ControlDef c;
    c.dynamics = ControlDynamics::kMuscle;
    c.time_constant = 0.005 + 0.02 * uniform(random);
    c.deactivation_time = 0.01 + 0.05 * uniform(random);
    c.smoothing = trial % 2 ? 0.5 * uniform(random) : 0;
    const double a = uniform(random), from = 1.4 * uniform(random) - 0.2, t = 0.02 * uniform(random);
    const double rate = trial % 3 ? (1.4 * uniform(random) - 0.2 - from) / t : 0;
    const mjtNum prm[3] = {c.time_constant, c.deactivation_time, c.smoothing};
    constexpr int kSteps = 20000;
    double expected = a;
    const double h = t / kSteps;
    for (int i = 0; i < kSteps;
         ++i) {  // the midpoint rule: 1e-4 of the step squared, or a kink's share of it
      const double u = from + rate * (i + 0.5) * h;
      const double middle = expected + 0.5 * h * mju_muscleDynamics(u - 0.5 * h * rate, expected, prm);
      expected += h * mju_muscleDynamics(u, middle, prm);
    }
    EXPECT_NEAR(internal::AdvanceActivation(c, a, from, rate, t), expected, 1e-7)
        << trial << ": from " << from << " rate " << rate << " a " << a << " smoothing " << c.smoothing;
  }
}

// Forces of all actuators and what they are on the joints, at random states.
void ExpectForces(const std::string& text, double angle, double speed) {
  Model model = Read(text);
  const mjModel& m = *model.mujoco;
  mjData& d = *model.data;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  double largest = 0;
  int passive = 0;
  for (int state = 0; state < 40; ++state) {
    mj_resetData(&m, &d);
    KeyframeDef key;
    const MechanismDef& def = model.imported.scene.mechanisms[0];
    KeyframeDef::MechanismState& s = key.mechanisms.emplace_back();
    s.X_WR = def.X_WR;
    s.q.resize(m.nv), s.q_dot.resize(m.nv);
    s.controls = VectorX::Zero(m.nu), s.activation = VectorX::Zero(m.nu);
    for (int i = 0; i < m.nv; ++i) {
      s.q(i) = angle * (1 + uniform(random)), s.q_dot(i) = speed * uniform(random);
      d.qpos[i] = m.qpos0[i] + s.q(i), d.qvel[i] = s.q_dot(i);
    }
    ASSERT_EQ(m.na, m.nu);
    for (int i = 0; i < m.nu; ++i) {
      ASSERT_EQ(def.controls[static_cast<std::size_t>(i)].name, mj_id2name(&m, mjOBJ_ACTUATOR, i));
      s.activation(i) = d.act[i] = 0.5 + 0.5 * uniform(random);
    }
    mj_forward(&m, &d);
    Scene scene = model.imported.scene;
    scene.keyframes = {key};
    const Simulation simulation = MustCreate(scene, 1.0 / 240);
    const Sensors sensors(simulation, model.imported.actuators);
    for (int i = 0; i < m.nu; ++i) {
      const double force = d.actuator_force[i];
      largest = std::max(largest, std::abs(force));
      EXPECT_NEAR(sensors.values()(i), force, 1e-9 * (1 + std::abs(force)))
          << state << " " << def.controls[std::size_t(i)].name;
    }
    const Mechanism mechanism = *BuildMechanism(def);
    Kinematics kinematics(mechanism);
    ComputeKinematics(mechanism, s.q, kinematics);
    for (std::size_t k = 0; k < mechanism.muscles().size(); ++k)
      passive += mechanism.PassivePart(k).Force(kinematics.muscles[k]) < 0;
    VectorX tau;
    SpringForce(mechanism, kinematics, s.q, tau);
    AddControlForce(mechanism, kinematics, s.activation, tau);
    AddMuscleRateForce(mechanism, kinematics, s.activation, s.q_dot, tau);
    for (int i = 0; i < m.nv; ++i) EXPECT_NEAR(tau(i), d.qfrc_actuator[i], 1e-9 * (1 + std::abs(tau(i))));
  }
  EXPECT_GT(largest, 10);
  EXPECT_GT(passive, 5);
}

TEST(MuscleForces, OfAnArmWithWrappedTendonsAreMuJoCos) { ExpectForces(kArm, 0.8, 8); }
TEST(MuscleForces, OnOtherTransmissionsAreMuJoCos) { ExpectForces(kOthers, 0.5, 5); }

TEST(MuscleMotion, IsMuJoCosOfSecondOrder) {
  Model model = Read(kArm, "k");
  const mjModel& m = *model.mujoco;
  mjData& d = *model.data;
  mj_resetDataKeyframe(&m, &d, 0);
  constexpr double kTime = 0.25;  // s
  for (int i = 0; i < std::lround(kTime / m.opt.timestep); ++i) mj_step(&m, &d);
  VectorX theirs(8);
  theirs << d.qpos[0], d.qpos[1], Eigen::Map<const Eigen::Matrix<double, 6, 1>>(d.act);
  VectorX moved = theirs;
  double reduced_error[3], full_error[3], activation_error[3];
  for (int k = 0; k < 3; ++k) {
    const double h = 1.0 / (240 << k);
    Simulation reduced = MustCreate(model.imported.scene, h);
    const VectorX start = reduced.JointCoordinates(0);
    FullSimulation full = Start(model.imported.scene, h, FullIntegrator::kTwoStages);
    for (int i = 0; i < std::lround(kTime / h); ++i) {
      EXPECT_TRUE(reduced.Step().stages_converged);
      EXPECT_TRUE(full.Step().converged);
    }
    EXPECT_GT((reduced.JointCoordinates(0) - start).cwiseAbs().maxCoeff(), 0.2);
    reduced_error[k] = (reduced.JointCoordinates(0) - theirs.head<2>()).norm();
    full_error[k] = (full.Displacements(0) - theirs.head<2>()).norm();
    activation_error[k] =
        (reduced.world().mechanisms()[0].activation() - theirs.tail<6>()).cwiseAbs().maxCoeff();
    // Two codes of one rule: the tolerance of a stage, 1e-6 of its motion, over a way of some radians.
    EXPECT_LT((full.Displacements(0) - reduced.JointCoordinates(0)).norm(), 5e-6) << h;
  }
  for (const double* error : {reduced_error, full_error}) {
    SCOPED_TRACE(std::to_string(error[0]) + " " + std::to_string(error[1]) + " " + std::to_string(error[2]));
    EXPECT_LT(error[0], 5e-3);
    EXPECT_LT(error[1], 0.35 * error[0]);
    EXPECT_LT(error[2], 0.35 * error[1]);
  }
  // Held inputs: it is exact but for the substeps of a smoothed one.
  for (const double error : activation_error) EXPECT_LT(error, 1e-7);
}

TEST(MuscleMotion, SavedIsRestoredWithAllItsBits) {
  Model model = Read(kArm, "k");
  Simulation simulation = MustCreate(model.imported.scene, 1.0 / 240);
  for (int i = 0; i < 10; ++i) simulation.Step();
  const Simulation::Snapshot then = simulation.Save();
  const std::uint64_t hash = simulation.HashState();
  for (int i = 0; i < 10; ++i) simulation.Step();
  const std::uint64_t end = simulation.HashState();
  ASSERT_TRUE(simulation.Restore(then));
  EXPECT_EQ(simulation.HashState(), hash);
  for (int i = 0; i < 10; ++i) simulation.Step();
  EXPECT_EQ(simulation.HashState(), end);
}

// Nothing but the passive parts stores energy, and nothing takes any.
TEST(MuscleMotion, PassivePartsConserveEnergy) {
  Model model = Read(kArm, "k");
  Scene scene = model.imported.scene;
  for (JointDef& joint : scene.mechanisms[0].joints) joint.freedoms[0].damping = 0;
  for (MuscleDef& muscle : scene.mechanisms[0].muscles) muscle.range_lower += 0.3, muscle.range_upper += 0.3;
  scene.keyframes[0].mechanisms[0].activation.setZero();
  scene.keyframes[0].mechanisms[0].controls.setZero();
  double lost[2], stored = 0;
  for (int k = 0; k < 2; ++k) {
    FullSimulation full = Start(scene, 1.0 / (960 << k), FullIntegrator::kTwoStages);
    Simulation reduced = MustCreate(scene, 1.0 / (960 << k));
    const double before = reduced.Energy();
    EXPECT_NEAR(full.SpringEnergy() + full.KineticEnergy(), before, 1e-9 * (1 + before));
    stored = std::max(stored, full.SpringEnergy());
    for (int i = 0; i < 96 << k; ++i) reduced.Step(), full.Step();
    lost[k] = std::abs(reduced.Energy() - before) / before;
  }
  EXPECT_GT(stored, 0.1);
  EXPECT_LT(lost[0], 1e-2);
  EXPECT_LT(lost[1], 0.35 * lost[0]);
}

}  // namespace
}  // namespace fork1s::reference_test::muscles
