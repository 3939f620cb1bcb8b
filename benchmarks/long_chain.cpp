// A chain of many joints built by hand: how long its reduction, a refresh and its steps take, and what it holds
// in memory: benchmarks/results/bench_chains.csv and the plot of docs/benchmarks.md.
//
//     build/release/benchmarks/long_chain [--plot FILE.svg] [JOINTS ...]     default: 100 200 500 1000 2000 5000
#include <fmt/format.h>

#include <cstdlib>
#include <lab/chain_cost.hpp>
#include <string>
#include <vector>

#include "benchmarks.hpp"
#include "record/output_file.hpp"

namespace fork1s::benchmarks::long_chain {

int Main(int argc, char** argv) {
  std::string plot;
  std::vector<int> sizes;
  for (int i = 1; i < argc; ++i) {
    if (argv[i] == std::string("--plot") && i + 1 < argc) {
      plot = argv[++i];
    } else if (const int joints = std::atoi(argv[i]); joints > 0) {
      sizes.push_back(joints);
    } else {
      fmt::print(stderr, "usage: long_chain [--plot FILE.svg] [JOINTS ...]\n");
      return 2;
    }
  }
  if (sizes.empty()) sizes = {100, 200, 500, 1000, 2000, 5000};
  if (!plot.empty() && sizes.size() < 2) {
    fmt::print(stderr, "long_chain: a plot needs two numbers of joints or more\n");
    return 2;
  }
  std::vector<ChainCost> rows;
  for (const int joints : sizes) {
    const auto cost = MeasureChain(joints);
    if (!cost) {
      fmt::print(stderr, "{}\n", cost.error().Text());
      return 1;
    }
    rows.push_back(*cost);
  }
  fmt::print("{}", ChainsCsv(rows));
  if (plot.empty()) return 0;
  if (auto written = WriteFile(plot, {"a plot", "<svg "}, DrawChains(rows)); !written) {
    fmt::print(stderr, "{}\n", written.error().Text());
    return 1;
  }
  return 0;
}

}  // namespace fork1s::benchmarks::long_chain
