// What `run` assumes: printed before the first step, and in the JSON.
#pragma once

#include "model_arguments.hpp"
#include "output.hpp"
#include "run_inputs.hpp"

namespace fork1s::app {

Json AssumptionsJson(const Simulation& simulation, const InputArguments& inputs, const ModelArguments& model);
void PrintAssumptions(const Json& assumed);

}  // namespace fork1s::app
