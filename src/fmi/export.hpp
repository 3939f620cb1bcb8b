// Models as functional mock-up units (FMI): archives that other simulators run.
#pragma once

#include <fork1s/base/error.hpp>
#include <string>
#include <vector>

#include "resources.hpp"

namespace fork1s::fmi {

struct ExportOptions {
  int version = 3;                  // of FMI: 2 or 3
  std::vector<std::string> bodies;  // that have variables; empty: interface bodies and free bodies
  std::string program;              // folder of the unit's program and of the libraries that it needs
  std::string tool;                 // "fork1s 0.2.0"
};

struct Exported {
  std::size_t inputs = 0, outputs = 0;
  double dt = 0;                      // s
  std::vector<std::string> warnings;  // of the reduction, and what has no variable
};

/// Writes `out`, of which nothing is left where it fails. Errors: those of the scene; kUsage for bodies that there are
/// not; kFile.
Expected<Exported> WriteUnit(const ImportedScene& imported, const SimulationOptions& simulation,
                             const ExportOptions& options, const std::string& out);

}  // namespace fork1s::fmi
