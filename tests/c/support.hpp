// Models and simulations by the C interface, and the same by C++.
#pragma once

#include <fork1s/fork1s.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace fork1s::testing {

struct FreeModel {
  void operator()(fork1s_model* m) const { fork1s_model_free(m); }
};
struct FreeSimulation {
  void operator()(fork1s_simulation* s) const { fork1s_simulation_free(s); }
};
using CModel = std::unique_ptr<fork1s_model, FreeModel>;
using CSimulation = std::unique_ptr<fork1s_simulation, FreeSimulation>;

inline std::string ScenePath(const char* name) { return std::string(FORK1S_SOURCE_DIR "/scenes/") + name; }

inline void Check(fork1s_status status) { ASSERT_EQ(status, FORK1S_OK) << fork1s_last_error(); }

inline CModel LoadInC(const std::string& path, const char* options = nullptr) {
  fork1s_model* model = nullptr;
  EXPECT_EQ(fork1s_model_load(path.c_str(), options, &model), FORK1S_OK) << fork1s_last_error();
  return CModel(model);
}

inline CSimulation CreateInC(const CModel& model, const char* options = nullptr) {
  fork1s_simulation* simulation = nullptr;
  EXPECT_EQ(fork1s_simulation_create(model.get(), options, &simulation), FORK1S_OK) << fork1s_last_error();
  return CSimulation(simulation);
}

inline Simulation Create(const ImportedScene& imported, SimulationOptions options = {}) {
  options.initial_keyframe = imported.initial_keyframe;
  return std::move(Simulation::Create(imported.scene, options).value());
}

inline std::uint64_t Hash(const CSimulation& simulation) {
  std::uint64_t hash = 0;
  Check(fork1s_simulation_hash(simulation.get(), &hash));
  return hash;
}

inline int Count(const CSimulation& simulation,
                 fork1s_status (*count)(const fork1s_simulation*, std::int32_t*)) {
  std::int32_t n = -1;
  Check(count(simulation.get(), &n));
  return n;
}

inline std::vector<double> Read(const CSimulation& simulation, std::size_t count,
                                fork1s_status (*read)(const fork1s_simulation*, double*, std::size_t)) {
  std::vector<double> values(count, -1);
  Check(read(simulation.get(), values.data(), values.size()));
  return values;
}

}  // namespace fork1s::testing
