// Set-points of a simulation.
#pragma once

#include <memory>
#include <string>

#include "arguments.hpp"
#include "runner.hpp"

namespace fork1s::python {

struct Controls {
  std::shared_ptr<Runner> runner;
};

/// Throws UnknownName, TypeError, or ValueError for a value that is not finite.
void SetControl(Runner& runner, const std::string& name, const Real& given);

}  // namespace fork1s::python
