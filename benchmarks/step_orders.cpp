// What a step of the full-coordinate simulator errs by on scenes, implicit Euler beside two stages: the table
// of docs/compare.md.
//
//     build/release/benchmarks/step_orders [SCENE[:SECONDS] ...]
//
// Some minutes; the truth is a run at 1/1920 s.
#include <fmt/format.h>

#include <lab/step_orders.hpp>
#include <string>
#include <vector>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::step_orders {

int Main(int argc, char** argv) {
  std::vector<std::string> names(argv + 1, argv + argc);
  if (names.empty())
    names = {"hand:2", "hexapod:2", "firemen:1", "grasp_box:2", "vehicle:2", "quadruped:1", "excavator:2"};
  std::vector<StepOrderRow> rows;
  for (const std::string& name : names) {
    const auto colon = name.find(':');
    const double seconds = colon == std::string::npos ? 1 : std::atof(name.c_str() + colon + 1);
    auto row = MeasureStepOrder(std::string(FORK1S_SOURCE) + "/scenes", name.substr(0, colon), seconds);
    if (!row) {
      fmt::print(stderr, "{}\n", row.error().Text());
      return 1;
    }
    fmt::print(stderr, "{}", StepOrderMarkdown({*row}));
    rows.push_back(*row);
  }
  fmt::print("{}", StepOrderMarkdown(rows));
  return 0;
}

}  // namespace fork1s::benchmarks::step_orders
