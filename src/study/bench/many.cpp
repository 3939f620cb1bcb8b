// Many simulations of one scene at a time, and one at many stiffnesses.
#include <chrono>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/csv.hpp>

#include "base/percentile.hpp"
#include "parallel/parallel_for.hpp"
#include "study/bench.hpp"

namespace fork1s {
namespace {

Expected<ControlTrack> ControlsOf(const BenchOptions& options) {
  if (options.controls_path.empty()) return ControlTrack();
  return ReadControls(options.controls_path);
}

}  // namespace

Expected<BenchStability> MeasureBenchStability(const BenchOptions& options) {
  auto controls = ControlsOf(options);
  if (!controls) return tl::unexpected(controls.error());
  BenchStability out{options.name, {}};
  Expected<std::vector<StabilityRow>> rows;
  WithThreads(1, [&] {
    rows = MeasureStability(options.model_path, *controls, options.time, {1, 10, 100, 1000});
  });
  if (!rows) return tl::unexpected(rows.error());
  out.rows = std::move(*rows);
  return out;
}

Expected<std::vector<ManyCost>> MeasureMany(const BenchOptions& options, int instances) {
  auto imported = LoadMechanism(options.model_path);
  if (!imported) return tl::unexpected(imported.error());
  auto controls = ControlsOf(options);
  if (!controls) return tl::unexpected(controls.error());
  SimulationOptions s;
  s.dt = options.dt;
  s.initial_keyframe = imported->initial_keyframe;
  std::vector<ManyCost> out;
  for (const int threads : {1, 2}) {
    std::vector<Simulation> simulations;
    for (int i = 0; i < instances; ++i) {
      auto made = Simulation::Create(imported->scene, s);
      if (!made) return tl::unexpected(made.error());
      simulations.push_back(std::move(*made));
    }
    const int steps = static_cast<int>(options.time / simulations.front().dt());
    std::vector<double> step_us;
    WithThreads(threads, [&] {
      for (int k = 0; k < steps; ++k) {
        const auto start = std::chrono::steady_clock::now();
        ParallelFor(0, instances, 1, [&](int begin, int end) {
          for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
            controls->Apply(simulations[i].time() + simulations[i].dt(), simulations[i]);
            simulations[i].Step(controls->times.size() > 1);
          }
        });
        step_us.push_back(
            std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count() /
            instances);
      }
    });
    out.push_back({options.name, instances, threads, Median(step_us)});
  }
  return out;
}

}  // namespace fork1s
