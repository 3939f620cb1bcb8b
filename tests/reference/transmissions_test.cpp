// Slack tendons, forces on sites and slider-cranks in motion: both simulators against MuJoCo's small steps.
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

// An arm of three links that swings by more than a right angle.
std::string Swinging(const std::string& rest) {
  return R"(<mujoco><compiler angle="radian"/><option integrator="RK4" timestep="1e-4"/><worldbody>
    <site name="w" pos=".3 .2 1"/><site name="rail" pos=".1 0 .7" euler="0 .4 .2"/>
    <body name="a" pos="0 0 1"><joint name="ja" axis="0 1 0" damping=".01"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass=".4" contype="0" conaffinity="0"/>
      <site name="sa" pos=".2 0 .03" euler=".3 0 .2"/>
      <body name="b" pos=".3 0 0"><joint name="jb" axis="0 1 .3" damping=".01"/>
        <geom type="capsule" fromto="0 0 0 .25 0 0" size=".02" mass=".3" contype="0" conaffinity="0"/>
        <body name="c" pos=".25 0 0"><joint name="jc" axis="0 0 1" stiffness=".3" damping=".01"/>
          <geom type="capsule" fromto="0 0 0 .2 0 .02" size=".02" mass=".2" contype="0" conaffinity="0"/>
          <site name="tip" pos=".2 0 0" euler=".2 .5 0"/></body></body></body></worldbody>)" +
         rest + "</mujoco>";
}

struct Ends {
  Vector3 theirs = Vector3::Zero(), full[2], two[2], reduced[2],
          reduced_two[2];  // m, of the tip; at a step and half of it
  double moved = 0;
};

void Run(const std::string& text, double seconds, double h, Ends& ends) {
  const auto path =
      std::filesystem::path(::testing::TempDir()) / ("fork1s_swing_" + std::to_string(getpid()) + ".xml");
  std::ofstream(path) << text;
  char error[500] = "";
  const std::unique_ptr<mjModel, void (*)(mjModel*)> model(mj_loadXML(path.c_str(), nullptr, error, 500),
                                                           mj_deleteModel);
  ImportOptions options;
  options.interfaces = {"a", "b", "c"};
  const auto imported = LoadMechanism(path.string(), options);
  std::filesystem::remove(path);
  ASSERT_NE(model, nullptr) << error;
  ASSERT_TRUE(imported) << imported.error().Text();
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  const auto& controls = imported->scene.mechanisms[0].controls;
  for (int i = 0; i < model->nu; ++i) data->ctrl[i] = 1;
  mj_forward(model.get(), data.get());
  const Eigen::Map<const Vector3> tip(data->xpos + 3 * mj_name2id(model.get(), mjOBJ_BODY, "c"));
  const Vector3 start = tip;
  while (data->time < seconds - 1e-9) mj_step(model.get(), data.get());
  mj_forward(model.get(), data.get());
  ends.theirs = tip;
  ends.moved = (tip - start).norm();
  const int steps = static_cast<int>(std::lround(seconds / h));
  for (int halved = 0; halved < 2; ++halved) {
    const double dt = h / (1 << halved);
    for (const FullIntegrator by : {FullIntegrator::kEuler, FullIntegrator::kTwoStages}) {
      FullSimulation full = Start(imported->scene, dt, by);
      for (std::size_t i = 0; i < controls.size(); ++i)
        full.SetControl(full.FindControl(controls[i].name), 1);
      Advance(full, seconds);
      (by == FullIntegrator::kEuler ? ends.full : ends.two)[halved] =
          full.Pose(full.FindBody("c")).translation();
    }
    for (const Integrator by : {Integrator::kEuler, Integrator::kTwoStage}) {
      SimulationOptions o;
      o.dt = dt;
      o.step.integrator = by;
      auto simulation = Simulation::Create(imported->scene, o);
      ASSERT_TRUE(simulation) << simulation.error().Text();
      for (const ControlDef& c : controls) simulation->SetControl(c.name, 1);
      for (int i = 0; i < steps << halved; ++i) simulation->Step();
      (by == Integrator::kEuler ? ends.reduced : ends.reduced_two)[halved] =
          simulation->Pose("c").translation();
    }
  }
}

// Of first order towards MuJoCo's path, some metres a second on ways of decimetres, by two stages of second.
void ExpectItsPath(const std::string& rest, double seconds) {
  Ends ends;
  Run(Swinging(rest), seconds, 2e-3, ends);
  const auto off = [&](const Vector3& p) { return (p - ends.theirs).norm(); };
  SCOPED_TRACE(
      "full " + std::to_string(off(ends.full[0])) + " " + std::to_string(off(ends.full[1])) + ", reduced " +
      std::to_string(off(ends.reduced[0])) + " " + std::to_string(off(ends.reduced[1])) + ", by two stages " +
      std::to_string(off(ends.reduced_two[0]) * 1e6) + " " + std::to_string(off(ends.reduced_two[1]) * 1e6) +
      " um, full by two stages " + std::to_string(off(ends.two[0]) * 1e6) + " " +
      std::to_string(off(ends.two[1]) * 1e6) + " um, moved " + std::to_string(ends.moved));
  EXPECT_GT(ends.moved, 0.1);
  EXPECT_LT(off(ends.full[1]), 6e-3);
  EXPECT_LT(off(ends.full[1]), 0.6 * off(ends.full[0]));
  EXPECT_LT(off(ends.reduced[1]), 6e-3);
  EXPECT_LT(off(ends.reduced[1]), 0.6 * off(ends.reduced[0]));
  EXPECT_LT(off(ends.reduced_two[1]), 2e-5);
  EXPECT_LT(off(ends.two[1]), 2e-5);
  EXPECT_LT(off(ends.two[1]), 0.3 * off(ends.two[0]));
}

TEST(Transmissions, SlackTendonsCatchAsMujocosDo) {
  ExpectItsPath(
      R"(<tendon><spatial name="rope" stiffness="300" springlength="0 .45"><site site="w"/><site site="tip"/></spatial>
    <fixed name="play" stiffness="8 2 5" springlength="-.2 .3"><joint joint="jb" coef="1"/><joint joint="jc" coef=".5"/></fixed>
    </tendon>)",
      0.6);
}

TEST(Transmissions, AForceThatTurnsWithItsSite) {
  ExpectItsPath(R"(<actuator><motor name="jet" site="tip" gear="-1 .3 3 0 .05 0"/></actuator>)", 0.5);
}

TEST(Transmissions, ServosBetweenSites) {
  ExpectItsPath(R"(<actuator><position name="reach" site="tip" refsite="w" gear=".5 0 1 0 0 0" kp="8"/>
    <position name="turn" site="tip" refsite="w" gear="0 0 0 .3 1 0" kp=".5"/></actuator>)",
                0.5);
}

TEST(Transmissions, ASliderCrank) {
  ExpectItsPath(
      R"(<actuator><position name="crank" cranksite="sa" slidersite="rail" cranklength=".45" kp="20"/></actuator>)",
      0.3);
}

}  // namespace
}  // namespace fork1s::reference_test
