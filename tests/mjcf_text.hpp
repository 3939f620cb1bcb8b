// Models written in a test: started here, and loaded in MuJoCo.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>
#include <fstream>
#include <memory>
#include <string>

namespace fork1s::testing {

inline constexpr double kGravity = 9.81;  // m/s²
/// Of a whole model, in space.
inline const std::array<Quaternion, 2> kTurns = {Quaternion::Identity(),
                                                 Quaternion(0.8, -0.3, 0.4, 0.33).normalized()};

inline ImportedScene MustLoad(const std::string& text) {
  auto loaded = LoadMechanismFromString(text, "test.xml", {});
  if (!loaded) throw std::runtime_error(loaded.error().Text());
  return std::move(*loaded);
}

inline Simulation MustStart(const std::string& text, double dt) {
  SimulationOptions options;
  options.dt = dt;
  auto simulation = Simulation::Create(MustLoad(text).scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

inline void RunUntil(Simulation& simulation, double until) {
  while (simulation.time() < until - 1e-9) {
    const StepReport report = simulation.Step();
    ASSERT_TRUE(report.finite && report.IsSolved()) << simulation.time();
  }
}

inline Vector3 Place(const Simulation& simulation, const std::string& body) {
  return simulation.Pose(body).translation();
}

using MujocoModel = std::unique_ptr<mjModel, void (*)(mjModel*)>;

/// Null, and a failure, where MuJoCo does not read it.
inline MujocoModel LoadInMujoco(const std::string& mjcf) {
  const auto path =
      std::filesystem::path(::testing::TempDir()) / fmt::format("fork1s_in_mujoco_{}.xml", getpid());
  std::ofstream(path) << mjcf;
  char error[500] = "";
  MujocoModel model(mj_loadXML(path.c_str(), nullptr, error, sizeof error), mj_deleteModel);
  std::filesystem::remove(path);
  EXPECT_NE(model, nullptr) << error;
  return model;
}

/// Steps until `time` [s], with the poses there.
inline void StepMujocoTo(double time, const mjModel& model, mjData& data) {
  while (data.time < time - 1e-6) mj_step(&model, &data);
  mj_kinematics(&model, &data);
}

}  // namespace fork1s::testing
