#include <fork1s/study/peer_table.hpp>

#include <algorithm>
#include <cmath>
#include <fork1s/base/percentile.hpp>
#include <fork1s/importer/importer.hpp>
#include <functional>
#include <numbers>

#include <fmt/format.h>

#include "runs.hpp"

namespace fork1s {
namespace {

using internal::Run;
using internal::RunOptions;
using internal::TrackedBody;

struct Entrant {
  std::string simulator;
  int substeps = 1;
  std::function<Expected<Run>()> simulate;
  PeerRow row;
  Run run;  // of the last round
  std::vector<double> step_s;
};

void SetError(const Run& run, const Run& truth, PeerRow& row) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 1; i < std::min(run.samples.size(), truth.samples.size()); ++i)
    for (std::size_t k = 0; k < run.samples[i].X_WB.size(); ++k, ++count) {
      const double mm =
          1e3 * (run.samples[i].X_WB[k].translation() - truth.samples[i].X_WB[k].translation()).norm();
      sum += mm * mm;
      row.max_mm = std::max(row.max_mm, mm);
    }
  if (count > 0) row.rms_mm = std::sqrt(sum / count);
}

void SetLoops(const Run& run, PeerRow& row) {
  for (const internal::Sample& s : run.samples) {
    row.loop_gap_mm = std::max(row.loop_gap_mm, 1e3 * s.gap);
    row.loop_turn_deg = std::max(row.loop_turn_deg, 180 / std::numbers::pi * s.loop_turn);
  }
}

// Three digits, without exponents down to a thousandth.
std::string PeerDigits(double x) {
  if (x > 0 && x < 1e-3) return fmt::format("{:.0e}", x);
  const int places = x > 0 ? std::clamp(2 - static_cast<int>(std::floor(std::log10(x))), 0, 4) : 0;
  return fmt::format("{:.{}f}", x, places);
}

}  // namespace

Expected<std::vector<PeerRow>> MeasurePeers(const PeerOptions& options) {
  FORK1S_REQUIRE(options.dt > 0 && options.time > 0 && options.rounds > 0);
  FORK1S_REQUIRE(options.truth_substeps >= 2 && options.truth_substeps % 2 == 0 &&
                 options.fine_substeps >= 1);
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
  std::vector<TrackedBody> tracked;
  for (std::size_t i = 0; i < probe->bodies().size(); ++i) {
    const SceneBody& b = probe->bodies()[i];
    if (b.is_interface || b.mechanism < 0) tracked.push_back({b.name, static_cast<int>(i), b.is_interface});
  }

  std::vector<Entrant> entrants;
  const auto reduced = [&](int substeps) {
    RunOptions at = o;
    at.substeps = substeps;
    entrants.push_back({"fork1s",
                        substeps,
                        [=, &scene, &tracked] { return internal::RunReduced(scene, tracked, at); },
                        {},
                        {},
                        {}});
  };
  const auto mujoco = [&](const char* name, MuJoCoIntegrator integrator, int substeps, bool tuned = false) {
    RunOptions at = o;
    at.mujoco_integrator = integrator;
    at.mujoco_tuned = tuned;
    entrants.push_back({name,
                        substeps,
                        [=, &scene, &tracked, &options] {
                          return internal::RunMuJoCo(
                              options.mujoco_path.empty() ? options.model_path : options.mujoco_path, scene,
                              tracked, options.dt / substeps, at);
                        },
                        {},
                        {},
                        {}});
  };
  const auto full = [&](int substeps) {
    RunOptions at = o;
    at.substeps = substeps;
    return internal::RunFull(scene, tracked, at);
  };
  reduced(1);
  mujoco("MuJoCo Euler", MuJoCoIntegrator::kEuler, 1);
  mujoco("MuJoCo implicitfast", MuJoCoIntegrator::kImplicitFast, 1);
  mujoco("MuJoCo discrete", MuJoCoIntegrator::kDiscrete, 1);
  const bool has_loops = std::any_of(scene.mechanisms.begin(), scene.mechanisms.end(),
                                     [](const MechanismDef& m) { return !m.closures.empty(); });
  mujoco("MuJoCo discrete, tuned", MuJoCoIntegrator::kDiscrete, 1, true);
  const std::size_t coarse = entrants.size();
  if (options.fine_substeps > 1) {
    reduced(options.fine_substeps);
    mujoco("MuJoCo Euler", MuJoCoIntegrator::kEuler, options.fine_substeps);
    mujoco("MuJoCo Euler, tuned", MuJoCoIntegrator::kEuler, options.fine_substeps, true);
  }
  const double time = o.samples * options.dt;
  for (int round = 0; round < options.rounds; ++round)
    for (std::size_t i = 0; i < entrants.size(); ++i) {
      Entrant& e = entrants[i];
      if (round > 0 && (i >= coarse || !e.row.survived)) continue;  // a fine run has steps enough
      auto run = e.simulate();
      if (!run && run.error().code != ErrorCode::kNumerics) return tl::unexpected(run.error());
      e.row.survived = run.has_value();
      if (!run) {
        e.row.end = run.error().message;
        continue;
      }
      e.step_s.insert(e.step_s.end(), run->step_s.begin(), run->step_s.end());
      e.run = std::move(*run);
    }
  for (int substeps : {1, options.truth_substeps / 2}) {
    auto run = full(substeps);
    if (!run) return tl::unexpected(run.error());
    Entrant e{"full", substeps, {}, {}, {}, run->step_s};
    e.row.survived = true;
    e.run = std::move(*run);
    entrants.insert(substeps == 1 ? entrants.begin() + static_cast<std::ptrdiff_t>(coarse) : entrants.end(),
                    std::move(e));
  }
  auto truth = full(options.truth_substeps);
  if (!truth) return tl::unexpected(truth.error());

  std::vector<PeerRow> rows;
  for (Entrant& e : entrants) {
    e.row.scene = options.scene;
    e.row.simulator = e.simulator;
    e.row.dt_s = options.dt / e.substeps;
    e.row.time_s = time;
    e.row.has_loops = has_loops;
    if (e.row.survived) {
      SetError(e.run, *truth, e.row);
      e.row.step_us = 1e6 * Median(e.step_s);
      if (has_loops) SetLoops(e.run, e.row);
    }
    rows.push_back(e.row);
  }
  for (PeerRow& row : rows)
    if (rows.front().step_us > 0) row.step_ratio = row.step_us / rows.front().step_us;
  return rows;
}

std::string PeerTableCsv(const std::vector<PeerRow>& rows) {
  std::string out =
      "scene,simulator,dt_s,simulated_s,survived,rms_mm,max_mm,step_us,step_ratio,loop_gap_mm,loop_turn_"
      "deg\n";
  for (const PeerRow& r : rows) {
    out += fmt::format("{},\"{}\",{:.6g},{:.6g},{}", r.scene, r.simulator, r.dt_s, r.time_s,
                       r.survived ? "yes" : "no");
    // What was not measured stays empty.
    out += r.survived
               ? fmt::format(",{:.4g},{:.4g},{:.4g},{:.4g}", r.rms_mm, r.max_mm, r.step_us, r.step_ratio)
               : ",,,,";
    out += r.survived && r.has_loops ? fmt::format(",{:.3g},", r.loop_gap_mm) : ",,";
    if (r.survived && r.has_loops && r.simulator != "full") out += fmt::format("{:.3g}", r.loop_turn_deg);
    out += "\n";
  }
  return out;
}

std::string PeerTableMarkdown(const std::vector<PeerRow>& rows) {
  std::string out =
      "| scene, simulated | simulator | step [s] | error, RMS and max [mm] | us a step | over fork1s | loops "
      "open by [mm], turned by [degrees] |\n|---|---|---|---|---|---|---|\n";
  std::string before;
  for (const PeerRow& r : rows) {
    const std::string scene = fmt::format("{}, {:.3g} s", r.scene, r.time_s);
    out += fmt::format("| {} | {} | 1/{:.0f} | ", scene == before ? "" : scene, r.simulator, 1 / r.dt_s);
    before = scene;
    if (!r.survived) {
      out += r.end + " | - | - | - |\n";
      continue;
    }
    out += fmt::format("{}, {} | {} | {} | ", PeerDigits(r.rms_mm), PeerDigits(r.max_mm),
                       PeerDigits(r.step_us), PeerDigits(r.step_ratio));
    out += !r.has_loops ? "none |\n"
           : r.simulator == "full"
               ? PeerDigits(r.loop_gap_mm) + " |\n"
               : fmt::format("{}, {} |\n", PeerDigits(r.loop_gap_mm), PeerDigits(r.loop_turn_deg));
  }
  return out;
}

}  // namespace fork1s
