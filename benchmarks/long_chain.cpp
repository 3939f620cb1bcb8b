// A chain of many joints built by hand: how long its reduction and its steps take, and what it holds in
// memory.
//
//     build/release/benchmarks/long_chain [JOINTS ...]     default: 100 200 500 1000 2000 5000
#include <fmt/format.h>

#include <cstdlib>
#include <fork1s/study/bench.hpp>
#include <vector>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::long_chain {

int Main(int argc, char** argv) {
  std::vector<int> sizes;
  for (int i = 1; i < argc; ++i) sizes.push_back(std::atoi(argv[i]));
  if (sizes.empty()) sizes = {100, 200, 500, 1000, 2000, 5000};
  fmt::print("joints,reduce_ms,step_us,heap_MB\n");
  for (const int joints : sizes) {
    const auto c = MeasureChain(joints);
    if (!c) {
      fmt::print(stderr, "{}\n", c.error().Text());
      return 1;
    }
    fmt::print("{},{:.3f},{:.2f},{:.3f}\n", c->joints, c->reduce_ms, c->step_us, c->heap_MB);
  }
  return 0;
}

}  // namespace fork1s::benchmarks::long_chain
