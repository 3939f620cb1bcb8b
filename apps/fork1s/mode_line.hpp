// Which coordinates a reduced model has, and what it leaves out.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>
#include <string>

#include "output.hpp"

namespace fork1s::app {

/// {kept, free, elastic, load_columns, below_hz, choice, left_out {count, lowest_hz, largest_m, largest_hz}}
Json ModesJson(const ReducedModel& model);
/// One line, without indentation.
std::string ModeLine(const Json& modes);

}  // namespace fork1s::app
