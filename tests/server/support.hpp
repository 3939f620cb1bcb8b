#pragma once

#include <gtest/gtest.h>
#include <fork1s/importer/importer.hpp>
#include <string>

#include "server/live_simulation.hpp"

namespace fork1s::test {

inline LiveSimulation Live(const std::string& scene, Recovery recovery = Recovery::kExact,
                           const std::string& keyframe = "") {
  ImportOptions import;
  import.keyframe = keyframe;
  auto imported = LoadMechanism(std::string(FORK1S_SOURCE_DIR "/scenes/") + scene, import);
  if (!imported) throw std::runtime_error(imported.error().Text());
  SimulationOptions options;
  options.recovery = recovery;
  options.initial_keyframe = imported->initial_keyframe;
  auto live = LiveSimulation::Create(imported->scene, options, scene);
  if (!live) throw std::runtime_error(live.error().Text());
  return std::move(*live);
}

inline Command Pull(int body, const Vector3& point_B, const Vector3& target_W, int viewer = 1) {
  Command c;
  c.kind = Command::Kind::kPull;
  c.viewer = viewer;
  c.body = body;
  c.point = point_B;
  c.target = target_W;
  return c;
}

inline Command Of(Command::Kind kind, bool on = false) {
  Command c;
  c.kind = kind;
  c.viewer = 1;
  c.on = on;
  return c;
}

inline Command Set(const std::string& setting, double value, int index = 0) {
  Command c = Of(Command::Kind::kSet);
  c.setting = setting;
  c.index = index;
  c.value = value;
  return c;
}

constexpr double kNoLimit = 1e9;  // s of wall time a frame may take in a test

}  // namespace fork1s::test
