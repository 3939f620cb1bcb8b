// What a benchmark's page shows.
#pragma once

#include <string>

#include "study/bench.hpp"

namespace fork1s::internal {

std::string BenchCsv(const BenchResults& results);
std::string BenchPage(const BenchResults& results);

/// A panel a scene: error over the time that a simulated second takes, one line a simulator, one point a
/// step.
std::string DrawPrecision(const BenchResults& results);
/// A panel a scene: the largest stable step over stiffness.
std::string DrawStability(const BenchResults& results);

}  // namespace fork1s::internal
