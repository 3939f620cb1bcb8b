// Poses of all bodies from the reduced state: what they cost, and how near that is to what this machine can.
#pragma once

#include <fork1s/base/error.hpp>
#include <optional>
#include <string>
#include <vector>

namespace fork1s {

/// Poses of all bodies from the reduced state.
struct RecoveryCost {
  std::string mechanism;  // "chain", or "four-bars", which has loops
  std::string mode;  // "exact", "curved", "twist", "second order"; ", arrays" and ", N states": PoseRecovery
  std::string type;  // of numbers
  int interfaces = 0, coordinates = 0, bodies = 0, threads = 1;
  double ns_per_body = 0;
  /// Least time that this machine's memory and arithmetic allow a body, as share of what it took. Of twists
  /// and arrays: of the others nobody counts bytes and operations; of closing loops exactly neither.
  std::optional<double> percent_of_ceiling;
  std::string bound;  // "memory" or "arithmetic"
};

/// Of chains of as many bodies, at 2 threads too where they are thousands, and of 32 four-bars.
Expected<std::vector<RecoveryCost>> MeasureRecovery(const std::vector<int>& bodies);

std::string RecoveryCsv(const std::vector<RecoveryCost>& rows);

}  // namespace fork1s
