#include <lab/scene_table.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fork1s/record/csv.hpp>
#include <fstream>
#include <limits>
#include <sstream>

#include <fmt/format.h>

#include "base/percentile.hpp"
#include "record/output_file.hpp"
#include "study/stable_runs.hpp"

namespace fork1s {
namespace {

using internal::FirstStable;
using internal::kLargestStep;
using internal::Run;
using internal::RunOptions;
using internal::TrackedBody;

void SetDistance(const std::vector<TrackedBody>& tracked, const Run& a, const Run& b, SceneRow& row) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 1; i < std::min(a.samples.size(), b.samples.size()); ++i)
    for (std::size_t k = 0; k < tracked.size(); ++k) {
      if (!tracked[k].is_interface) continue;
      const double mm =
          1e3 * (a.samples[i].X_WB[k].translation() - b.samples[i].X_WB[k].translation()).norm();
      sum += mm * mm;
      row.max_mm = std::max(row.max_mm, mm);
      ++count;
    }
  row.rms_mm = count > 0 ? std::sqrt(sum / count) : 0;
}

void SetCost(const Run& run, double time, SceneRow& row) {
  row.coordinates = run.coordinates;
  row.dt_s = row.largest_stable_dt_s = run.dt;
  row.step_us = 1e6 * Median(run.step_s);
  row.real_time_factor = run.wall_s() > 0 ? time / run.wall_s() : 0;
}

std::string StepText(double dt) {
  return dt > 0 ? fmt::format("1/{:.0f}", 1 / dt) : fmt::format("< 1/{}", 60 << internal::kHalvings);
}

// Three digits, without exponents.
std::string Digits(double x) {
  const int places = x > 0 ? std::clamp(2 - static_cast<int>(std::floor(std::log10(x))), 0, 4) : 0;
  return fmt::format("{:.{}f}", x, places);
}

std::string NameOf(const std::string& simulator) {
  if (simulator == "mujoco") return "MuJoCo";
  return simulator == "mujoco_discrete" ? "MuJoCo discrete" : simulator;
}

std::string CostText(const SceneRow& row) { return row.step_us > 0 ? Digits(row.step_us) : std::string("-"); }

}  // namespace

Expected<std::vector<SceneRow>> MeasureScene(const std::string& folder, const std::string& name,
                                             double time_limit_s, const std::string& controls_of) {
  const std::string path = folder + "/" + name + ".xml",
                    table = folder + "/" + (controls_of.empty() ? name : controls_of) + ".csv";
  auto imported = LoadMechanism(path);
  if (!imported) return tl::unexpected(imported.error());
  ImportOptions stiff;
  stiff.stiffness_scale = 100;
  auto stiffer = LoadMechanism(path, stiff);
  if (!stiffer) return tl::unexpected(stiffer.error());
  ControlTrack controls;
  if (std::filesystem::exists(table)) {
    auto read = ReadControls(table);
    if (!read) return tl::unexpected(read.error());
    controls = std::move(*read);
  }
  const Scene& scene = imported->scene;
  RunOptions o;
  o.interval = kLargestStep;
  const double wanted = controls.times.empty() ? time_limit_s : std::min(time_limit_s, controls.times.back());
  o.samples = std::max(1, static_cast<int>(std::llround(wanted / kLargestStep)));
  o.initial_keyframe = imported->initial_keyframe;
  o.controls = &controls;
  auto probe = internal::MakeReduced(scene, o);
  if (!probe) return tl::unexpected(probe.error());
  const std::vector<TrackedBody> tracked = internal::TrackedBodies(*probe);
  SceneRow base;
  base.scene = name;
  base.time_s = o.samples * kLargestStep;
  base.bodies = static_cast<int>(probe->bodies().size());
  for (const TrackedBody& b : tracked) base.interface_bodies += b.is_interface ? 1 : 0;

  auto truth = internal::RunFull(scene, tracked, o);
  if (!truth) return tl::unexpected(truth.error());
  SceneRow reduced = base, full = base;

  reduced.simulator = "reduced";
  auto run = FirstStable(*truth, [&](int k) {
    RunOptions at = o;
    at.substeps = 1 << k;
    return internal::RunReduced(scene, tracked, at);
  });
  if (!run) return tl::unexpected(run.error());
  if (*run) {
    SetCost(**run, base.time_s, reduced);
    SetDistance(tracked, **run, *truth, reduced);
  }
  auto stiff_truth = internal::RunFull(stiffer->scene, tracked, o);
  if (!stiff_truth && stiff_truth.error().code != ErrorCode::kNumerics)
    return tl::unexpected(stiff_truth.error());
  auto stiff_run = internal::RunReduced(stiffer->scene, tracked, o);
  if (!stiff_run && stiff_run.error().code != ErrorCode::kNumerics) return tl::unexpected(stiff_run.error());
  if (stiff_truth) reduced.stable_stiff = stiff_run && internal::IsStable(*stiff_run, *stiff_truth);

  // It bounds itself, so that finite numbers are all that is asked of it here.
  full.simulator = "full";
  SetCost(*truth, base.time_s, full);
  RunOptions half = o;
  half.substeps = 2;
  auto finer = internal::RunFull(scene, tracked, half);
  if (!finer) return tl::unexpected(finer.error());
  SetDistance(tracked, *truth, *finer, full);

  std::vector<SceneRow> rows{reduced, full};
  for (const bool discrete : {false, true}) {
    SceneRow mujoco = base;
    mujoco.simulator = discrete ? "mujoco_discrete" : "mujoco";
    RunOptions at = o;
    if (discrete) at.mujoco_integrator = MuJoCoIntegrator::kDiscrete;
    run = FirstStable(*truth, [&](int k) {
      return internal::RunMuJoCo(path, scene, tracked, kLargestStep / (1 << k), at);
    });
    if (!run) return tl::unexpected(run.error());
    if (*run) {
      SetCost(**run, base.time_s, mujoco);
      SetDistance(tracked, **run, *truth, mujoco);
    }
    rows.push_back(std::move(mujoco));
  }
  for (SceneRow& row : rows) {
    if (reduced.step_us > 0) row.step_ratio = row.step_us / reduced.step_us;
    if (row.real_time_factor > 0) row.cost_ratio = reduced.real_time_factor / row.real_time_factor;
  }
  return rows;
}

std::string SceneTableCsv(const std::vector<SceneRow>& rows) {
  std::string out =
      "scene,simulator,interface_bodies,bodies,coordinates,simulated_s,dt_s,step_us,real_time_factor,"
      "largest_stable_dt_s,stable_at_60_Hz_stiffness_x100,rms_mm,max_mm,step_ratio,cost_ratio\n";
  for (const SceneRow& r : rows)
    out += fmt::format("{},{},{},{},{},{:.6g},{:.6g},{:.4g},{:.4g},{:.6g},{},{:.4g},{:.4g},{:.4g},{:.4g}\n",
                       r.scene, r.simulator, r.interface_bodies, r.bodies, r.coordinates, r.time_s, r.dt_s,
                       r.step_us, r.real_time_factor, r.largest_stable_dt_s,
                       r.stable_stiff ? (*r.stable_stiff ? "yes" : "no") : "", r.rms_mm, r.max_mm,
                       r.step_ratio, r.cost_ratio);
  return out;
}

std::string SceneTableMarkdown(const std::vector<SceneRow>& rows) {
  std::string out =
      "| scene | bodies | coordinates: reduced, full, MuJoCo | us a step: reduced, full, MuJoCo as the file "
      "has it, discrete | largest stable step [s]: reduced, full, MuJoCo, discrete | stable at 1/60 with 100 "
      "x "
      "stiffness | reduced from full, RMS and max [mm] | time a simulated second, over reduced: full, "
      "MuJoCo, "
      "discrete |\n"
      "|---|---|---|---|---|---|---|---|\n";
  const auto ratio = [](const SceneRow& row) {
    return row.cost_ratio > 0 ? Digits(row.cost_ratio) : std::string("-");
  };
  for (std::size_t i = 0; i + 3 < rows.size(); i += 4) {
    const SceneRow &r = rows[i], &f = rows[i + 1], &m = rows[i + 2], &d = rows[i + 3];
    out += fmt::format(
        "| [{}]({}.md) | {} | {}, {}, {} | {}, {}, {}, {} | {}, {}, {}, {} | {} | {}, {} | {}, {}, {} |\n",
        r.scene, r.scene, r.bodies, r.coordinates, f.coordinates,
        std::max(m.coordinates, d.coordinates),  // 0 where no step was stable
        CostText(r), CostText(f), CostText(m), CostText(d), StepText(r.largest_stable_dt_s),
        StepText(f.largest_stable_dt_s), StepText(m.largest_stable_dt_s), StepText(d.largest_stable_dt_s),
        r.stable_stiff ? (*r.stable_stiff ? "yes" : "no") : "-", Digits(r.rms_mm), Digits(r.max_mm), ratio(f),
        ratio(m), ratio(d));
  }
  return out;
}

std::string ScenePageMarkdown(const std::vector<SceneRow>& rows) {
  std::string out =
      "| simulator | coordinates | step [s] | us a step | times real time | from full, RMS and max [mm] |\n"
      "|---|---|---|---|---|---|\n";
  for (const SceneRow& r : rows) {
    const bool survived = r.largest_stable_dt_s > 0;
    const std::string measured = fmt::format("{}, {}", Digits(r.rms_mm), Digits(r.max_mm));
    const std::string distance = !survived               ? "-"
                                 : r.simulator == "full" ? "from its own half step: " + measured
                                                         : measured;
    out += fmt::format("| {} | {} | {} | {} | {} | {} |\n", NameOf(r.simulator), r.coordinates,
                       StepText(r.largest_stable_dt_s), CostText(r),
                       survived ? Digits(r.real_time_factor) : "-", distance);
  }
  return out;
}

Expected<void> ReplaceTable(const std::string& path, const std::string& text) {
  static const std::string kBegin = "<!-- table: begin -->\n", kEnd = "<!-- table: end -->";
  std::ifstream in(path, std::ios::binary);
  std::stringstream read;
  read << in.rdbuf();
  if (!in) return Fail(ErrorCode::kFile, path, "cannot be read");
  std::string page = read.str();
  const auto begin = page.find(kBegin), end = page.find(kEnd);
  if (begin == std::string::npos || end == std::string::npos || end < begin)
    return Fail(ErrorCode::kFormat, path, "has no lines <!-- table: begin --> and <!-- table: end -->");
  const auto first = begin + kBegin.size();
  page.replace(first, end - first, text);
  return WriteFile(path, {"the page that was read", page.substr(0, begin)}, page);
}

}  // namespace fork1s
