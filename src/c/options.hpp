// Options of the C interface: JSON text with the names that Python has.
#pragma once

#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>
#include <optional>
#include <string>

namespace fork1s::c {

struct LoadOptions {
  ImportOptions import;
  std::string reader;     // program that reads in a process of its own; empty: this process reads
  double read_time = 60;  // s
};

struct RunOptions {
  SimulationOptions simulation;
  std::optional<std::string> keyframe;
};

/// `text`: NULL, or one JSON object. Throw Refused (kUsage) for what is no JSON, unknown and repeated names, and values
/// that make no sense.
LoadOptions ReadLoadOptions(const char* text);
RunOptions ReadRunOptions(const char* text);

}  // namespace fork1s::c
