// Nanoseconds a body for the poses of all bodies of chains and of four-bars, and how near that is to what this
// machine's memory and arithmetic allow: benchmarks/results/bench_recovery.csv.
//
//     build/release/benchmarks/recovery_cost [BODIES ...]     of the chains; default: 100 1000 10000
#include <fmt/format.h>

#include <cstdlib>
#include <lab/recovery_cost.hpp>
#include <vector>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::recovery_cost {

int Main(int argc, char** argv) {
  std::vector<int> bodies;
  for (int i = 1; i < argc; ++i) bodies.push_back(std::atoi(argv[i]));
  if (bodies.empty()) bodies = {100, 1000, 10000};
  for (const int count : bodies)
    if (count < 6) {
      fmt::print(stderr, "usage: recovery_cost [BODIES ...], of a chain with six interface bodies or more\n");
      return 2;
    }
  const auto rows = MeasureRecovery(bodies);
  if (!rows) {
    fmt::print(stderr, "{}\n", rows.error().Text());
    return 1;
  }
  fmt::print("{}", RecoveryCsv(*rows));
  return 0;
}

}  // namespace fork1s::benchmarks::recovery_cost
