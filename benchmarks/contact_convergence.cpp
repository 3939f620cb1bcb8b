// How the contact solver fares in scenes: iterations, what helped them, what was left unsolved, how deep
// contacts sink.
//
//     build/release/benchmarks/contact_convergence SECONDS MODEL...
//
// A table of controls beside a model, MODEL with .csv in place of .xml, drives it. Steps of 1/60 s. One row
// of a Markdown table a model; residuals are those of the worst step.
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "benchmarks.hpp"
#include "scene_run.hpp"

namespace fork1s::benchmarks::contact_convergence {
namespace {

constexpr double kTimeStep = 1.0 / 60;  // s

bool PrintRow(const std::string& path, double seconds) {
  std::vector<int> iterations;
  int steps = 0, helped = 0, softer = 0, unconverged = 0, most = 0;
  double residual_impulse = 0, residual_speed = 0, penetration = 0;
  const bool ran = RunScene(path, seconds, kTimeStep, [&](Simulation&, const StepReport& report) {
    if (!report.finite) return false;
    ++steps;
    if (report.solver.active > 0) iterations.push_back(report.solver.newton_iterations);
    helped += report.solver.fallback == 1 || report.solver.fallback == 2;
    softer += report.solver.fallback > 2;
    unconverged += !report.solver.converged;
    most = std::max(most, report.contacts);
    residual_impulse = std::max(residual_impulse, report.solver.residual_impulse);
    residual_speed = std::max(residual_speed, report.solver.residual_speed);
    penetration = std::max(penetration, report.max_penetration);
    return true;
  });
  if (!ran) return false;
  std::sort(iterations.begin(), iterations.end());
  const auto at = [&](double share) {
    if (iterations.empty()) return 0;
    return iterations[static_cast<std::size_t>(share * static_cast<double>(iterations.size() - 1))];
  };
  fmt::print("| {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.1e} | {:.1e} | {:.0f} |\n",
             std::filesystem::path(path).stem().string(), steps, most, at(0.5), at(0.99), at(1), helped,
             softer, unconverged, residual_impulse / kTimeStep, residual_speed, 1e6 * penetration);
  return true;
}

}  // namespace

int Main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "usage: contact_convergence SECONDS MODEL...\n");
    return 2;
  }
  fmt::print(
      "| scene | steps | contacts, most | iterations, median | p99 | most | dilatancy or frozen bounds | softer or path | "
      "unsolved "
      "| residual N | m/s | deepest µm |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  bool good = true;
  for (int i = 2; i < argc; ++i) good = PrintRow(argv[i], std::atof(argv[1])) && good;
  return good ? 0 : 3;
}

}  // namespace fork1s::benchmarks::contact_convergence
