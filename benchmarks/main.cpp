// All benchmarks in one program, since most of what each compiles and links is the same: `bench NAME ...`, or
// by a link of that name beside it, as the build makes them.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>

#include "benchmarks.hpp"

namespace {

using namespace fork1s::benchmarks;

struct Benchmark {
  const char* name;
  int (*main)(int argc, char** argv);
};

constexpr Benchmark kBenchmarks[] = {{"accuracy", accuracy::Main},
                                     {"contact_convergence", contact_convergence::Main},
                                     {"contact_problems", contact_problems::Main},
                                     {"contact_recorded", contact_recorded::Main},
                                     {"detail_levels", detail_levels::Main},
                                     {"detector_accuracy", detector_accuracy::Main},
                                     {"error_families", error_families::Main},
                                     {"legged", legged::Main},
                                     {"legged_rules", legged_rules::Main},
                                     {"live_rate", live_rate::Main},
                                     {"long_and_many", long_and_many::Main},
                                     {"long_chain", long_chain::Main},
                                     {"peer_table", peer_table::Main},
                                     {"recovery_cost", recovery_cost::Main},
                                     {"refresh_cost", refresh_cost::Main},
                                     {"scene_table", scene_table::Main},
                                     {"soak", soak::Main},
                                     {"step_cost", step_cost::Main},
                                     {"step_instructions", step_instructions::Main},
                                     {"step_orders", step_orders::Main},
                                     {"validation", validation::Main}};

const Benchmark* Find(const std::string& name) {
  const auto at = std::find_if(std::begin(kBenchmarks), std::end(kBenchmarks),
                               [&](const Benchmark& b) { return name == b.name; });
  return at == std::end(kBenchmarks) ? nullptr : at;
}

}  // namespace

int main(int argc, char** argv) {
  if (const Benchmark* called = Find(std::filesystem::path(argv[0]).filename().string()))
    return called->main(argc, argv);
  if (argc > 1)
    if (const Benchmark* named = Find(argv[1])) return named->main(argc - 1, argv + 1);
  std::fputs("usage: bench NAME ...; benchmarks/NAME.cpp says what it takes. Names:\n", stderr);
  for (const Benchmark& b : kBenchmarks) std::fprintf(stderr, "  %s\n", b.name);
  return 2;
}
