// Dampers, armature, dry friction and motors of ball joints act on the angular velocity: closed forms and MuJoCo.
#include <mujoco/mujoco.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>
#include <fstream>
#include <memory>
#include <random_mechanism.hpp>
#include <string>

#include "support.hpp"

namespace fork1s::reference_test {
namespace {

constexpr double kSpinnerInertia = 1e-3;  // kg·m²

MechanismDef Spinner(double damping, double armature, const Vector3& gear = Vector3::Zero(),
                     double torque = 0) {
  MechanismBuilder builder("spinner");
  BodyDef body;
  body.name = "b";
  body.parent = builder.base();
  body.inertia.mass = 0.1;
  body.inertia.rotational = kSpinnerInertia * Matrix3::Identity();
  const JointIndex joint = builder.AddJoint(
      JointDef::Ball("j", builder.AddBody(body)).WithSpring(0, damping).WithArmature(armature));
  builder.SetInterfaces({"b"});
  MechanismDef def = builder.definition();
  ControlDef motor;
  motor.name = "m";
  for (int k = 0; k < 3; ++k) motor.terms.emplace_back(FreedomRef{joint, k}, gear(k));
  motor.gain = 1;
  motor.initial = torque;
  def.controls.push_back(motor);
  return def;
}

FullSimulation Turning(const MechanismDef& def, const Vector3& theta, const Vector3& omega, double h,
                       FullIntegrator integrator) {
  Scene scene = Of(def);
  StartAt(scene, theta, DexpInverseRotation(-theta) * omega);
  return Start(std::move(scene), h, integrator);
}

TEST(BallJoint, DampedSpinBeyondHalfPiDecaysAsInEveryPose) {
  const double d = 2e-3, a = 5e-4, rate = d / (kSpinnerInertia + a), turn = (1 - std::exp(-rate)) / rate;
  for (unsigned seed = 0; seed < 4; ++seed) {
    testing::RandomSource random(seed);
    const Vector3 theta = random.Uniform(1.6, 3.0) * random.Direction(), omega = 2 * random.Direction();
    for (const FullIntegrator integrator : {FullIntegrator::kEuler, FullIntegrator::kTwoStages}) {
      FullSimulation s = Turning(Spinner(d, a), theta, omega, 1.0 / 240, integrator);
      const double energy = 0.5 * (kSpinnerInertia + a) * omega.squaredNorm();
      EXPECT_NEAR(s.KineticEnergy(), energy, 1e-12 * energy);
      Advance(s, 1);
      const Matrix3 expected = ExpRotation(theta) * ExpRotation(turn * omega);
      const double tolerance = integrator == FullIntegrator::kEuler ? 5e-3 : 1e-4;
      EXPECT_LT(LogRotation(expected.transpose() * s.Pose(s.FindBody("b")).rotation()).norm(), tolerance)
          << "seed " << seed;
      EXPECT_NEAR(s.KineticEnergy(), energy * std::exp(-2 * rate), 2 * tolerance * energy) << "seed " << seed;
    }
  }
}

TEST(BallJoint, MotorAtTwoRadiansTurnsAboutTheAxisOfTheBody) {
  const double torque = 2e-3, time = 0.2;
  for (unsigned seed = 0; seed < 4; ++seed) {
    testing::RandomSource random(seed);
    const Vector3 theta = 2 * random.Direction(), gear = random.Direction();
    FullSimulation s = Turning(Spinner(0, 1e-3, gear, torque), theta, Vector3::Zero(), time / 40,
                               FullIntegrator::kTwoStages);
    Advance(s, time);
    const Vector3 turn = 0.5 * torque / (2 * kSpinnerInertia) * time * time * gear;
    const Matrix3 expected = ExpRotation(theta) * ExpRotation(turn);
    EXPECT_LT(LogRotation(expected.transpose() * s.Pose(s.FindBody("b")).rotation()).norm(), 1e-4)
        << "seed " << seed;
  }
}

// A chain of rods on ball joints with dampers, rotors and motors, which starts far from where θ is small.
const char* const kChain = R"(<mujoco><compiler angle="radian"/>
  <option integrator="RK4" timestep="2e-4" gravity="0 0 -3"/>
  <custom><text name="fork1s_interface" data="a,b,c"/></custom>
  <default><geom type="box" size=".05 .02 .01" pos=".05 .01 0" mass=".2" contype="0" conaffinity="0"/></default>
  <worldbody><body name="a"><joint name="ja" type="ball" damping=".01" armature=".003"/><geom/>
    <body name="b" pos=".1 0 0"><joint name="jb" type="ball" damping=".004" armature=".001" stiffness=".05"/><geom/>
      <body name="c" pos=".1 0 0"><joint name="jc" type="ball" damping=".002"/><geom/></body></body></body></worldbody>
  <actuator><motor name="m" joint="ja" gear=".02 -.03 .01"/><motor name="n" joint="jb" gear="0 .01 0"/>
    <motor name="o" joint="jc" gear="0 0 .005"/></actuator>
  <keyframe><key name="k" qpos=".4536 .8912 0 0  .6967 .3 .6 .2553  .5403 0 .5950 .5950" qvel="1 2 -1 0 3 1 -2 0 1"
    ctrl="1 1 1"/></keyframe></mujoco>)";

TEST(BallJoint, ChainOfBallJointsConvergesToMuJoCosPath) {
  const auto path =
      std::filesystem::path(::testing::TempDir()) / ("fork1s_balls_" + std::to_string(getpid()) + ".xml");
  std::ofstream(path) << kChain;
  char error[500] = "";
  const std::unique_ptr<mjModel, void (*)(mjModel*)> model(mj_loadXML(path.c_str(), nullptr, error, 500),
                                                           mj_deleteModel);
  auto imported = LoadMechanism(path.string(), {});
  std::filesystem::remove(path);
  ASSERT_NE(model, nullptr) << error;
  ASSERT_TRUE(imported) << imported.error().Text();
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  mj_resetDataKeyframe(model.get(), data.get(), 0);
  constexpr double kTime = 0.4;  // s
  while (data->time < kTime - 1e-9) mj_step(model.get(), data.get());
  mj_forward(model.get(), data.get());
  const auto far = [&](const auto& s) {
    double most = 0;
    for (const char* name : {"a", "b", "c"}) {
      const int id = mj_name2id(model.get(), mjOBJ_BODY, name);
      Matrix3 R;
      mju_quat2Mat(R.data(), data->xquat + 4 * id);  // row by row
      most = std::max(most, LogRotation(R * s.Pose(s.FindBody(name)).rotation()).norm());
    }
    return most;
  };
  double last = 0;
  for (const int steps : {200, 400}) {
    FullSimulation s = Start(imported->scene, kTime / steps, FullIntegrator::kTwoStages);
    Advance(s, kTime);
    EXPECT_LT(far(s), 1e-2 * 200 * 200 / steps / steps) << "full";
    SimulationOptions options;
    options.dt = kTime / steps;
    options.step.integrator = Integrator::kTwoStage;
    options.initial_keyframe = 0;
    auto reduced = Simulation::Create(imported->scene, options);
    ASSERT_TRUE(reduced) << reduced.error().Text();
    for (int i = 0; i < steps; ++i) reduced->Step();
    EXPECT_LT(far(*reduced), 1e-2 * 200 * 200 / steps / steps) << "reduced";
    if (steps > 200) {
      EXPECT_LT(far(*reduced), 0.4 * last) << "second order";
    }
    last = far(*reduced);
  }
}

}  // namespace
}  // namespace fork1s::reference_test
