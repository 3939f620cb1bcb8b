#include "phases.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/importer/importer.hpp>
#include <numeric>

#include "../runs.hpp"
#include "base/percentile.hpp"

namespace fork1s::internal {

PhaseCost& PhaseOf(BenchScene& scene, const std::string& phase) {
  const auto known = std::find_if(scene.phases.begin(), scene.phases.end(),
                                  [&](const PhaseCost& p) { return p.phase == phase; });
  if (known != scene.phases.end()) return *known;
  scene.phases.emplace_back().phase = phase;
  return scene.phases.back();
}

Expected<void> TimePhases(const BenchOptions& options, const ControlTrack& controls, double dt,
                          BenchScene& scene) {
  auto imported = LoadMechanism(options.model_path);
  if (!imported) return tl::unexpected(imported.error());
  RunOptions run;
  run.interval = dt;
  run.samples = std::max(1, static_cast<int>(std::llround(options.time / dt)));
  run.initial_keyframe = imported->initial_keyframe;
  run.controls = &controls;
  run.energy = false;
  run.watch_parts = true;
  run.integrator = scene.integrator;
  std::vector<std::vector<StepPartTimes>> rounds;
  for (int round = 0; round < options.rounds; ++round) {
    auto done = RunReduced(imported->scene, {}, run);
    if (!done) return tl::unexpected(done.error());
    rounds.push_back(std::move(done->parts));
  }
  // Each step counts with its median over the rounds.
  const auto names = PartsOf({});
  for (std::size_t part = 0; part < names.size(); ++part) {
    std::vector<double> of_step;
    for (std::size_t i = 0; i < rounds.front().size(); ++i) {
      std::vector<double> us;
      for (const auto& round : rounds) us.push_back(1e6 * PartsOf(round[i])[part].second);
      of_step.push_back(Median(us));
    }
    PhaseCost& cost = PhaseOf(scene, names[part].first);
    cost.mean_us = std::accumulate(of_step.begin(), of_step.end(), 0.0) / static_cast<double>(of_step.size());
    cost.median_us = Median(of_step);
  }
  return {};
}

}  // namespace fork1s::internal
