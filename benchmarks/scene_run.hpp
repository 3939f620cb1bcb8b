// A scene with its table of controls, step by step.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <functional>
#include <string>

namespace fork1s::benchmarks {

/// Runs a model at steps of `h` [s]; a table of controls beside it, with .csv in place of .xml, drives it.
/// `after` is called after every step; false ends the run. Errors are printed; then false.
bool RunScene(const std::string& path, double seconds, double h,
              const std::function<bool(Simulation&, const StepReport&)>& after);

}  // namespace fork1s::benchmarks
