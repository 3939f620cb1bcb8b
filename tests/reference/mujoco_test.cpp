// Large motion against MuJoCo's Runge-Kutta steps on the same file, of fourth order and so far below our own
// error.
#include <mujoco/mujoco.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fork1s/importer/importer.hpp>
#include <fstream>
#include <memory>
#include <string>

#include "support.hpp"

namespace fork1s::reference_test {
namespace {

// Six sprung rods that fall to the side, hinged about axes in all directions, with a ball joint, a slide and
// rotors.
std::string Model() {
  const char* joints[] = {
      "<joint axis='0 1 0' stiffness='2' damping='.02'/>",
      "<joint axis='0 1 1' stiffness='1' damping='.02' armature='.001'/>",
      "<joint type='ball' stiffness='0' damping='.02'/>",
      "<joint axis='1 0 0' damping='.01'/><joint axis='0 0 1' stiffness='1' springref='20'/>",
      "<joint type='slide' axis='1 0 0' stiffness='50' damping='.5'/>",
      "<joint axis='0 1 0' stiffness='.5' damping='.01'/>"};
  std::string open, close;
  for (int i = 0; i < 6; ++i) {
    open += "<body name='b" + std::to_string(i) + "' pos='" + (i == 0 ? "0 0 1" : ".1 0 0") + "'>" +
            joints[i] +
            "<geom type='box' pos='.05 0 .01' size='.05 .02 .01' mass='.1' contype='0' conaffinity='0'/>";
    close += "</body>";
  }
  return "<mujoco><option integrator='RK4' timestep='2e-4'/><worldbody>" + open + close +
         "</worldbody></mujoco>";
}

TEST(MuJoCo, FallingChainConvergesToItsPath) {
  const auto path =
      std::filesystem::path(::testing::TempDir()) / ("fork1s_chain_" + std::to_string(getpid()) + ".xml");
  std::ofstream(path) << Model();
  char error[500] = "";
  const std::unique_ptr<mjModel, void (*)(mjModel*)> model(mj_loadXML(path.c_str(), nullptr, error, 500),
                                                           mj_deleteModel);
  ImportOptions options;
  options.interfaces = {"b5"};
  auto imported = LoadMechanism(path.string(), options);
  std::filesystem::remove(path);
  ASSERT_NE(model, nullptr) << error;
  ASSERT_TRUE(imported) << imported.error().Text();
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  constexpr double kTime = 0.4;  // s
  while (data->time < kTime - 1e-9) mj_step(model.get(), data.get());
  mj_forward(model.get(), data.get());
  const int id = mj_name2id(model.get(), mjOBJ_BODY, "b5");
  const Vector3 expected = Eigen::Map<const Vector3>(data->xpos + 3 * id);

  auto distance = [&](double h) {
    FullSimulation s = Start(imported->scene, h);
    Advance(s, kTime);
    return (s.Pose(s.FindBody("b5")).translation() - expected).norm();
  };
  const double coarse = distance(1e-3), fine = distance(5e-4);
  // First order, on a path of some decimetres.
  EXPECT_NEAR(std::log2(coarse / fine), 1, 0.1) << coarse << " " << fine;
  EXPECT_LT(fine, 2e-3);
  EXPECT_GT((expected - Vector3(0.5, 0, 1)).norm(), 0.2);
}

}  // namespace
}  // namespace fork1s::reference_test
