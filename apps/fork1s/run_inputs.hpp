// What `run` is moved by: the table of --controls, --push, --detail; and what of it is not taken as it
// stands.
#pragma once

#include <string>
#include <vector>

#include "run_measure.hpp"

namespace fork1s::app {

struct InputArguments {
  std::string controls;             // path; empty: none
  std::vector<std::string> pushes;  // see PushTrack::Parse
  std::string detail;
  Recovery recovery = Recovery::kExact;
};

/// Errors: as of ReadControls, PushTrack and FidelityTrack.
Expected<RunInputs> ReadInputs(const InputArguments& args);
/// Errors: kModel for columns, kUsage for a --push, of what the simulation does not have.
Expected<void> CheckInputs(const RunInputs& inputs, const InputArguments& args, const Simulation& simulation);
/// Sentences on what a run of `time` seconds does not take as it stands: values outside a control's range,
/// rows and pushes after the end.
std::vector<std::string> InputLimits(const RunInputs& inputs, const InputArguments& args,
                                     const Simulation& simulation, double time);

}  // namespace fork1s::app
