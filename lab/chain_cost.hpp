// What a chain of many joints costs.
#pragma once

#include <fork1s/base/error.hpp>
#include <string>
#include <vector>

namespace fork1s {

/// A chain of hinges with springs, its last body the interface, on one thread.
struct ChainCost {
  int joints = 0;
  double reduce_ms = 0, refresh_ms = 0;
  double step_us = 0;  // of backward Euler by one Newton iteration, without contact, with all poses
  double heap_MB = 0;
};
Expected<ChainCost> MeasureChain(int joints);

std::string ChainsCsv(const std::vector<ChainCost>& rows);
/// Reduction, refresh and step over the number of joints: an SVG file. Two rows at least, by ascending joints.
std::string DrawChains(const std::vector<ChainCost>& rows);

}  // namespace fork1s
