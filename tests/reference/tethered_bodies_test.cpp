// Free bodies on tendons, and pushed by actuators on their sites: both simulators against MuJoCo's small steps.
#include <mujoco/mujoco.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>
#include <fstream>
#include <memory>
#include <string>

#include "support.hpp"

namespace fork1s::reference_test {
namespace {

struct Distances {
  double full[2], reduced[2];  // m and rad, of the body from where MuJoCo has it: at a step and half of it
  double moved = 0;            // m and rad, by its way and its turn
};

// By two stages from the file's keyframe, with every control at `control`.
void Run(const std::string& text, const std::string& body, double control, double seconds, double h,
         Distances& distances) {
  const auto path =
      std::filesystem::path(::testing::TempDir()) / ("fork1s_tethered_" + std::to_string(getpid()) + ".xml");
  std::ofstream(path) << text;
  char error[500] = "";
  const std::unique_ptr<mjModel, void (*)(mjModel*)> model(mj_loadXML(path.c_str(), nullptr, error, 500),
                                                           mj_deleteModel);
  const auto imported = LoadMechanism(path.string(), {});
  std::filesystem::remove(path);
  ASSERT_NE(model, nullptr) << error;
  ASSERT_TRUE(imported) << imported.error().Text();
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  mj_resetDataKeyframe(model.get(), data.get(), 0);
  for (int i = 0; i < model->nu; ++i) data->ctrl[i] = control;
  const int id = mj_name2id(model.get(), mjOBJ_BODY, body.c_str());
  const auto pose = [&] {
    mj_forward(model.get(), data.get());
    const mjtNum *p = data->xpos + 3 * id, *q = data->xquat + 4 * id;
    return RigidTransform(Quaternion(q[0], q[1], q[2], q[3]), Vector3(p[0], p[1], p[2]));
  };
  while (data->time < seconds - 1e-9) {
    const RigidTransform before = pose();
    mj_step(model.get(), data.get());
    const RigidTransform now = pose();
    distances.moved += LogRotation(before.rotation().transpose() * now.rotation()).norm() +
                       (now.translation() - before.translation()).norm();
  }
  const RigidTransform theirs = pose();
  const auto distance = [&](const RigidTransform& ours) {
    return (ours.translation() - theirs.translation()).norm() +
           LogRotation(ours.rotation().transpose() * theirs.rotation()).norm();
  };
  for (int halved = 0; halved < 2; ++halved) {
    const double dt = h / (1 << halved);
    FullSimulation full = Start(imported->scene, dt, FullIntegrator::kTwoStages);
    SimulationOptions options;
    options.dt = dt;
    options.initial_keyframe = 0;
    options.step.integrator = Integrator::kTwoStage;
    auto reduced = Simulation::Create(imported->scene, options);
    ASSERT_TRUE(reduced) << reduced.error().Text();
    for (const MechanismDef& mechanism : imported->scene.mechanisms)
      for (const ControlDef& c : mechanism.controls) {
        full.SetControl(full.FindControl(c.name), control);
        reduced->SetControl(c.name, control);
      }
    Advance(full, seconds);
    const int steps = static_cast<int>(std::lround(seconds / dt));
    for (int i = 0; i < steps; ++i) reduced->Step();
    distances.full[halved] = distance(full.Pose(full.FindBody(body)));
    distances.reduced[halved] = distance(reduced->Pose(body));
  }
}

// Of second order towards MuJoCo's path, which is `moves` long at least [m and rad].
void ExpectItsPath(const std::string& text, const std::string& body, double control, double seconds,
                   double moves) {
  Distances d;
  Run(text, body, control, seconds, 1.0 / 240, d);
  SCOPED_TRACE("full " + std::to_string(d.full[0]) + " " + std::to_string(d.full[1]) + ", reduced " +
               std::to_string(d.reduced[0]) + " " + std::to_string(d.reduced[1]) + ", moved " +
               std::to_string(d.moved));
  EXPECT_GT(d.moved, moves);
  EXPECT_LT(d.full[1], 1e-3 * d.moved);
  EXPECT_LT(d.reduced[1], 1e-3 * d.moved);
  EXPECT_LT(d.full[1], 0.35 * d.full[0]);
  EXPECT_LT(d.reduced[1], 0.35 * d.reduced[0]);
}

constexpr const char* kOption = R"(<compiler angle="radian"/><option integrator="RK4" timestep="1e-4"/>)";

TEST(TetheredBodies, PlatformOnThreeCords) {
  ExpectItsPath(std::string("<mujoco>") + kOption + R"(<worldbody>
    <site name="pA" pos="-1 0 2"/><site name="pB" pos="1 0 2"/><site name="pC" pos="0 1 2"/>
    <body name="platform" pos="0 0 1" euler="0 0 .2"><freejoint/><geom type="box" size=".1 .1 .02" mass="2"/>
      <site name="a" pos="-.1 0 .02"/><site name="b" pos=".1 0 .02"/><site name="c" pos="0 .1 .02"/></body></worldbody>
    <tendon><spatial stiffness="500" damping="5"><site site="pA"/><site site="a"/></spatial>
    <spatial stiffness="500" damping="5"><site site="pB"/><site site="b"/></spatial>
    <spatial stiffness="500" damping="5"><site site="pC"/><site site="c"/></spatial></tendon>
    <keyframe><key qpos="0 .02 .95 1 .05 0 .1"/></keyframe></mujoco>)",
                "platform", 0, 1, 0.5);
}

// More than one full turn about an axis that moves, far from where its coordinates begin.
TEST(TetheredBodies, BoxThatSpinsOnACord) {
  ExpectItsPath(std::string("<mujoco>") + kOption + R"(<worldbody><site name="hook"/>
    <body name="box" pos="1 0 0" euler=".5 .7 .9"><freejoint/><geom type="box" size=".1 .05 .02" mass="1"/>
      <site name="eye" pos=".1 0 0"/></body></worldbody>
    <tendon><spatial stiffness="20"><site site="hook"/><site site="eye"/></spatial></tendon>
    <keyframe><key qpos="1 .3 0 1 0 0 0" qvel="0 2 0 2 8 1"/></keyframe></mujoco>)",
                "box", 0, 1, 3 * M_PI);
}

// Nothing holds the pair in the world.
TEST(TetheredBodies, TwoBodiesTiedToEachOther) {
  ExpectItsPath(std::string("<mujoco>") + kOption + R"(<worldbody>
    <body name="a" pos="0 0 1"><freejoint/><geom type="box" size=".1 .05 .02" mass="1"/><site name="sa" pos=".1 0 0"/></body>
    <body name="b" pos="1 0 1"><freejoint/><geom type="capsule" size=".05 .1" mass="3"/><site name="sb" pos="0 0 .1"/></body>
    </worldbody><tendon><spatial stiffness="40" damping=".2"><site site="sa"/><site site="sb"/></spatial></tendon>
    <keyframe><key qpos="0 0 1 1 0 0 0  1 0 1 1 0 0 0" qvel="0 2 0 0 0 3  0 -1 1 2 0 0"/></keyframe></mujoco>)",
                "a", 0, 1, 3);
}

// Thrust that turns with the body: a drone that rolls over as it climbs.
TEST(TetheredBodies, DroneByThrustOfItsRotors) {
  ExpectItsPath(std::string("<mujoco>") + kOption + R"(<worldbody>
    <body name="drone" pos="0 0 1"><freejoint/><geom type="box" size=".1 .1 .02" mass=".4"/>
      <site name="left" pos="0 .1 0"/><site name="right" pos="0 -.1 0"/><site name="fore" pos=".1 0 0"/></body></worldbody>
    <actuator><motor site="left" gear="0 0 1.01 0 0 -.02"/><motor site="right" gear="0 0 1 0 0 .03"/>
    <motor site="fore" gear="0 0 .01"/></actuator>
    <keyframe><key qpos="0 0 1 1 0 0 0"/></keyframe></mujoco>)",
                "drone", 3, 2, 3);
}

}  // namespace
}  // namespace fork1s::reference_test
