#include "study/peers.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/importer/importer.hpp>
#include <numbers>

#include <fmt/format.h>

#include "base/percentile.hpp"
#include "runs.hpp"

namespace fork1s {
namespace {

using internal::Run;
using internal::RunOptions;
using internal::TrackedBody;

struct Entrant {
  PeerEntrant what;
  PeerRow row;
  Run run;                                  // of the last round
  std::vector<std::vector<double>> step_s;  // of every round
};

Run RunOf(const PeerMotion& motion) {
  Run run;
  run.step_s = motion.step_s;
  for (const auto& positions : motion.positions) {
    run.samples.emplace_back();
    for (const Vector3& p : positions) run.samples.back().X_WB.emplace_back(p);
  }
  return run;
}

void SetTimes(const Entrant& e, PeerRow& row) {
  std::vector<double> all, of_step, refreshed;
  const std::size_t steps = e.step_s.front().size();
  for (std::size_t i = 0; i < steps; ++i) {
    std::vector<double> rounds;
    for (const auto& round : e.step_s) rounds.push_back(1e6 * round[i]);
    of_step.push_back(Median(rounds));
    if (i < e.run.refreshed.size() && e.run.refreshed[i]) refreshed.push_back(of_step.back());
    all.insert(all.end(), rounds.begin(), rounds.end());
  }
  row.step_us = Median(all);
  row.p99_us = Percentile(of_step, 0.99);
  row.worst_us = Percentile(of_step, 1);
  row.refreshes = static_cast<int>(refreshed.size());
  if (!refreshed.empty()) row.refresh_step_us = Median(refreshed);
}

void SetError(const Run& run, const Run& truth, PeerRow& row) {
  double sum = 0, moved = 0;
  int count = 0;
  for (std::size_t i = 1; i < std::min(run.samples.size(), truth.samples.size()); ++i)
    for (std::size_t k = 0; k < run.samples[i].X_WB.size(); ++k, ++count) {
      const Vector3 there = truth.samples[i].X_WB[k].translation();
      const double mm = 1e3 * (run.samples[i].X_WB[k].translation() - there).norm();
      sum += mm * mm;
      moved += 1e6 * (there - truth.samples[0].X_WB[k].translation()).squaredNorm();
      row.max_mm = std::max(row.max_mm, mm);
    }
  if (count > 0) row.rms_mm = std::sqrt(sum / count);
  constexpr double kStandsStill = 1e-3;  // mm: what rounding and settling move is no motion to compare with
  if (moved > count * kStandsStill * kStandsStill) row.error_percent = 100 * std::sqrt(sum / moved);
}

void SetLoops(const Run& run, PeerRow& row) {
  for (const internal::Sample& s : run.samples) {
    row.loop_gap_mm = std::max(row.loop_gap_mm, 1e3 * s.gap);
    row.loop_turn_deg = std::max(row.loop_turn_deg, 180 / std::numbers::pi * s.loop_turn);
  }
}

}  // namespace

Expected<std::vector<PeerRow>> MeasurePeers(const PeerOptions& options) {
  FORK1S_REQUIRE(options.dt > 0 && options.time > 0 && options.rounds > 0);
  FORK1S_REQUIRE(options.truth_substeps >= 2 && options.truth_substeps % 2 == 0);
  FORK1S_REQUIRE(!options.entrants.empty());
  ImportOptions import;
  import.keyframe = options.keyframe;
  auto imported = LoadMechanism(options.model_path, import);
  if (!imported) return tl::unexpected(imported.error());
  const Scene& scene = imported->scene;
  RunOptions o;
  o.interval = options.dt;
  o.samples = std::max(1, static_cast<int>(std::llround(options.time / options.dt)));
  o.initial_keyframe = imported->initial_keyframe;
  o.controls = &options.controls;
  o.energy = false;
  auto probe = internal::MakeReduced(scene, o);
  if (!probe) return tl::unexpected(probe.error());
  if (const auto missing = options.controls.FindMissing(*probe); !missing.empty())
    return Fail(ErrorCode::kModel, options.model_path, "has no control '" + missing.front() + "'");
  const std::vector<TrackedBody> tracked = internal::TrackedBodies(*probe);
  const bool has_loops = std::any_of(scene.mechanisms.begin(), scene.mechanisms.end(),
                                     [](const MechanismDef& m) { return !m.closures.empty(); });
  std::vector<Entrant> entrants;
  for (const PeerEntrant& what : options.entrants) entrants.push_back({what, {}, {}, {}});
  std::vector<std::string> names;
  for (const TrackedBody& b : tracked) names.push_back(b.name);
  const auto simulate = [&](const PeerEntrant& what) -> Expected<Run> {
    if (what.outside) {
      auto motion = what.outside(scene, names, options.dt, o.samples, what.substeps);
      if (!motion) return tl::unexpected(motion.error());
      return RunOf(*motion);
    }
    RunOptions at = o;
    at.substeps = what.substeps;
    at.integrator = what.own_integrator;
    at.mujoco_integrator = what.integrator;
    at.mujoco_tuned = what.tuned;
    if (!what.is_mujoco) return internal::RunReduced(scene, tracked, at);
    const std::string& path = options.mujoco_path.empty() ? options.model_path : options.mujoco_path;
    return internal::RunMuJoCo(path, scene, tracked, options.dt / what.substeps, at);
  };
  const auto full = [&](int substeps, FullIntegrator integrator = FullIntegrator::kTwoStages) {
    RunOptions at = o;
    at.substeps = substeps;
    at.full_integrator = integrator;
    return internal::RunFull(scene, tracked, at);
  };
  // In steps, with a guess of what one of the full model's is worth: it is what takes long.
  constexpr double kFullWorth = 100;
  double to_do = kFullWorth * (2 + 1.5 * options.truth_substeps), done = 0;
  for (const Entrant& e : entrants) to_do += e.what.substeps == 1 ? options.rounds : e.what.substeps;
  const auto book = [&](double worth) {
    done += worth;
    if (options.progress) options.progress(done / to_do);
  };
  const double time = o.samples * options.dt;
  for (int round = 0; round < options.rounds; ++round)
    for (Entrant& e : entrants) {
      if (round > 0 && (e.what.substeps > 1 || !e.row.survived)) continue;  // a fine run has steps enough
      auto run = simulate(e.what);
      book(e.what.substeps);
      const bool may_end = e.what.outside || e.what.is_mujoco;
      if (!run && run.error().code != ErrorCode::kNumerics && !may_end) return tl::unexpected(run.error());
      e.row.survived = run.has_value();
      if (!run) {
        e.row.end = run.error().message;
        continue;
      }
      e.step_s.push_back(run->step_s);
      e.run = std::move(*run);
    }
  auto coarse =
      std::find_if(entrants.begin(), entrants.end(), [](const Entrant& e) { return e.what.substeps > 1; }) -
      entrants.begin();
  for (const auto& [substeps, integrator] : {std::pair{1, FullIntegrator::kTwoStages},
                                             {1, FullIntegrator::kEuler},
                                             {options.truth_substeps / 2, FullIntegrator::kTwoStages}}) {
    auto run = full(substeps, integrator);
    book(kFullWorth * substeps);
    if (!run) return tl::unexpected(run.error());
    Entrant e{{integrator == FullIntegrator::kEuler ? "full euler" : "full"}, {}, {}, {run->step_s}};
    e.what.substeps = substeps;
    e.row.survived = true;
    e.run = std::move(*run);
    entrants.insert(substeps == 1 ? entrants.begin() + coarse++ : entrants.end(), std::move(e));
  }
  auto truth = full(options.truth_substeps);
  book(kFullWorth * options.truth_substeps);
  if (!truth) return tl::unexpected(truth.error());

  std::vector<PeerRow> rows;
  for (Entrant& e : entrants) {
    e.row.scene = options.scene;
    e.row.simulator = e.what.name;
    e.row.dt_s = options.dt / e.what.substeps;
    e.row.time_s = time;
    e.row.has_loops = has_loops;
    if (e.row.survived) {
      SetError(e.run, *truth, e.row);
      SetTimes(e, e.row);
      if (has_loops) SetLoops(e.run, e.row);
    }
    rows.push_back(e.row);
  }
  for (PeerRow& row : rows)
    if (rows.front().step_us > 0) row.step_ratio = row.step_us / rows.front().step_us;
  return rows;
}

}  // namespace fork1s
