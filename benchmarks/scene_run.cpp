#include "scene_run.hpp"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/csv.hpp>

namespace fork1s::benchmarks {

bool RunScene(const std::string& path, double seconds, double h,
              const std::function<bool(Simulation&, const StepReport&)>& after) {
  const auto fail = [](const Error& error) {
    fmt::print(stderr, "{}\n", error.Text());
    return false;
  };
  auto imported = LoadMechanism(path);
  if (!imported) return fail(imported.error());
  SimulationOptions options;
  options.dt = h;
  auto simulation = Simulation::Create(imported->scene, options);
  if (!simulation) return fail(simulation.error());
  ControlTrack track;
  const auto controls = std::filesystem::path(path).replace_extension(".csv");
  if (std::filesystem::exists(controls)) {
    auto read = ReadControls(controls.string());
    if (!read) return fail(read.error());
    track = std::move(*read);
  }
  const int steps = static_cast<int>(std::lround(seconds / h));
  for (int i = 0; i < steps; ++i) {
    track.Apply((i + 1) * h, *simulation);
    if (!after(*simulation, simulation->Step())) break;
  }
  return true;
}

}  // namespace fork1s::benchmarks
