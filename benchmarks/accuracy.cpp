// Accuracy of the method: docs/accuracy.md with its plots and tables.
//
//     build/release/benchmarks/accuracy [--out docs]     about two minutes
#include <fmt/format.h>

#include <cstring>
#include <lab/accuracy.hpp>
#include <string>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::accuracy {

int Main(int argc, char** argv) {
  std::string out = "docs";
  if (argc == 3 && std::strcmp(argv[1], "--out") == 0) {
    out = argv[2];
  } else if (argc != 1) {
    fmt::print(stderr, "usage: accuracy [--out FOLDER]\n");
    return 1;
  }
  if (auto written = fork1s::WriteAccuracyPage(FORK1S_SOURCE "/scenes", out); !written) {
    fmt::print(stderr, "{}\n", written.error().Text());
    return 1;
  }
  fmt::print("{0}/accuracy.md and {0}/accuracy/\n", out);
  return 0;
}

}  // namespace fork1s::benchmarks::accuracy
