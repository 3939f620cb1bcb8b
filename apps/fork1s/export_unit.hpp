// 'fork1s export MODEL OUT.fmu'.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <optional>
#include <string>
#include <vector>

#include "model_arguments.hpp"

namespace fork1s::app {

/// The group of the options that AddTo adds.
inline constexpr const char* kUnitOptions = "Options of a functional mock-up unit (FILE.fmu)";

struct UnitArguments {
  int fmi = 3;
  double dt = 0;  // s; 0: the model's
  std::optional<Integrator> integrator;
  Recovery recovery = Recovery::kExact;
  std::vector<std::string> bodies;

  void AddTo(CLI::App& command);
};

/// Writes the model to `out` and says what it did; the exit code.
int ExportUnit(const ModelArguments& model, const UnitArguments& unit, const std::string& out);

}  // namespace fork1s::app
