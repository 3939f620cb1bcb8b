// What a truncated model leaves out follows its loads to where the whole mechanism would rest.
#include <gtest/gtest.h>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>

namespace fork1s {
namespace {

struct Rest {
  Vector3 position;
  double moved = 0;  // m, in the last step
  int refreshes = 0;
};

Rest RestOf(Scene scene, const std::string& body, const Vector3& force, double time) {
  SimulationOptions options;
  options.step.integrator = Integrator::kEuler;  // the way to the rest is no matter
  auto simulation = Simulation::Create(std::move(scene), options);
  EXPECT_TRUE(simulation) << simulation.error().Text();
  const int b = simulation->FindBody(body);
  Rest rest;
  const int steps = static_cast<int>(time * 60);
  for (int i = 0; i < steps; ++i) {
    const Vector3 before = simulation->Pose(b).translation();
    simulation->ApplyWrench(b, std::min(1.0, i / 120.0) * force, Vector3::Zero(), before);
    rest.refreshes += simulation->Step().refreshes;
    rest.position = simulation->Pose(b).translation();
    rest.moved = (rest.position - before).norm();
  }
  return rest;
}

// Kilonewtons through the men's arms turn loops by more than a reference is good for.
TEST(Rest, LoadedLoopsWithoutModesRestWhereAllModesDo) {
  std::vector<Rest> rests;
  for (int modes : {0, 4, 1000}) {
    ImportOptions options;
    options.modes = modes;
    auto imported = LoadMechanism(FORK1S_SOURCE_DIR "/scenes/firemen.xml", options);
    ASSERT_TRUE(imported) << imported.error().Text();
    Scene scene = imported->scene;
    scene.free_bodies.clear();
    // Heavy damping: the way to the rest is no matter here.
    for (JointDef& joint : scene.mechanisms[0].joints)
      for (FreedomDef& freedom : joint.freedoms) freedom.damping = 0.2 * freedom.stiffness;
    rests.push_back(RestOf(scene, "sheet", Vector3(150, 80, -900), 40));
    EXPECT_LT(rests.back().moved, 1e-9) << modes;
  }
  // The loads' columns are those of the last reference, up to 15 degrees away.
  EXPECT_LT((rests[0].position - rests[2].position).norm(), 2e-4);
  EXPECT_LT((rests[1].position - rests[2].position).norm(), 2e-4);
}

// A rope of a metre: its weight holds it more than its springs do.
TEST(Rest, AHangingChainWithWeakSpringsComesToRest) {
  std::string body, end;
  for (int i = 1; i <= 10; ++i) {
    const std::string n = std::to_string(i);
    body +=
        "<body name='link" + n + "' pos='0 0 " + (i == 1 ? "2" : "-0.1") + "'><joint name='j" + n +
        "' axis='0 1 0' stiffness='0.5' damping='0.5'/>"
        "<geom type='capsule' fromto='0 0 0 0 0 -0.1' size='0.005' mass='0.2' contype='0' conaffinity='0'/>";
    end += "</body>";
  }
  std::vector<Rest> rests;
  for (int modes : {0, 1000}) {
    ImportOptions options;
    options.interfaces = {"link10"};
    options.modes = modes;
    auto imported = LoadMechanismFromString(
        "<mujoco model='rope'><worldbody>" + body + end + "</worldbody></mujoco>", "rope", options);
    ASSERT_TRUE(imported) << imported.error().Text();
    rests.push_back(RestOf(imported->scene, "link10", Vector3(2, 0, 0), 150));
    EXPECT_LT(rests.back().moved, 1e-9) << modes;
  }
  EXPECT_LT((rests[0].position - rests[1].position).norm(), 1e-5);
  EXPECT_LT(rests[0].refreshes, 30);
}

}  // namespace
}  // namespace fork1s
