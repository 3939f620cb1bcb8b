// Loads a machine for a test, or skips the test where its model is not beside the sources.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <legged.hpp>
#include <ostream>

namespace fork1s::examples {

inline LeggedOptions Folders() {
  LeggedOptions options;
  options.scenes = FORK1S_SOURCE_DIR "/scenes";
  options.models = FORK1S_SOURCE_DIR "/../shared/models";
  return options;
}

/// Why the machine cannot be had; empty where it can.
inline std::string WhyMissing(LeggedRobot robot) {
  const std::string file = ModelFile(robot, Folders().models);
  if (file.empty() || std::filesystem::exists(file)) return "";
  return "the model of " + std::string(Name(robot)) + " is not beside the sources (../shared/models)";
}

struct Case {
  LeggedRobot robot;
  LeggedGround ground = LeggedGround::kFlat;
  double gain_scale = 1;
};
inline std::ostream& operator<<(std::ostream& out, const Case& c) {
  return out << Name(c.robot) << " on " << Name(c.ground) << " ground, gains x" << c.gain_scale;
}

inline LeggedScene Load(const Case& c) {
  LeggedOptions options = Folders();
  options.ground = c.ground;
  options.gain_scale = c.gain_scale;
  auto legged = LoadLegged(c.robot, options);
  if (!legged) throw std::runtime_error(legged.error().Text());
  return std::move(*legged);
}

inline Simulation Start(const Scene& scene, const SimulationOptions& options) {
  auto simulation = Simulation::Create(scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

}  // namespace fork1s::examples
