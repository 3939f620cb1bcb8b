// Instructions of a step, counted by valgrind.
#pragma once

#include <string>
#include <vector>

#include "study/bench.hpp"

namespace fork1s::internal {

/// Runs BenchOptions::step_command once for fork1s and once for each of MuJoCo's integrators, and counts what
/// the steps take: `scene`.instructions, `scene`.phases or `scene`.why_no_instructions.
void CountInstructions(const BenchOptions& options, BenchScene& scene);

/// Instructions of all calls of a function with all that they call, in what callgrind_annotate
/// --inclusive=yes prints; 0: it is not in it.
double InclusiveInstructions(const std::string& annotated, const std::string& function);

}  // namespace fork1s::internal
