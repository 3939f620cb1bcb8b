// Set-points of a simulation.
#pragma once

#include <memory>
#include <string>

#include "runner.hpp"

namespace fork1s::python {

struct Controls {
  std::shared_ptr<Runner> runner;
};

/// Throws UnknownName, or ValueError for a value that is not finite.
void SetControl(Runner& runner, const std::string& name, double value);

}  // namespace fork1s::python
