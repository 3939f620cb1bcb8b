// Which bodies may touch, by name: what a full-coordinate simulation beside a reduced one must be told.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <string>
#include <vector>

namespace fork1s {

/// Mechanism by mechanism, as the reduction settled on them: those that the definition names, else those it
/// chose. Bodies that hold one of the frozen contacts may touch, what they hold is named by nobody.
std::vector<std::vector<std::string>> InterfaceNames(const Simulation& simulation);

}  // namespace fork1s
