// What `run` says at its end: JSON, and the lines made of it.
#pragma once

#include "output.hpp"
#include "run_measure.hpp"

namespace fork1s::app {

Json Summary(const Simulation& simulation, const Measured& measured);
void PrintSummary(const Json& summary);

}  // namespace fork1s::app
