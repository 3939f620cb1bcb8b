#include <lab/step_orders.hpp>

#include <cmath>
#include <filesystem>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/csv.hpp>

#include <fmt/format.h>

#include "study/runs.hpp"

namespace fork1s {
namespace {

using internal::Run;
using internal::RunOptions;

// RMS over bodies and samples; `still`: from where b starts.
double Apart(const Run& a, const Run& b, bool still = false) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 1; i < a.samples.size(); ++i)
    for (std::size_t k = 0; k < a.samples[i].X_WB.size(); ++k, ++count)
      sum +=
          (a.samples[i].X_WB[k].translation() - b.samples[still ? 0 : i].X_WB[k].translation()).squaredNorm();
  return count > 0 ? std::sqrt(sum / count) : 0;
}

}  // namespace

Expected<StepOrderRow> MeasureStepOrder(const std::string& folder, const std::string& name, double time_s) {
  const std::string path = folder + "/" + name + ".xml", table = folder + "/" + name + ".csv";
  auto imported = LoadMechanism(path);
  if (!imported) return tl::unexpected(imported.error());
  ControlTrack controls;
  if (std::filesystem::exists(table)) {
    auto read = ReadControls(table);
    if (!read) return tl::unexpected(read.error());
    controls = std::move(*read);
  }
  RunOptions o;
  o.interval = 1.0 / 60;
  o.samples = std::max(1, static_cast<int>(std::llround(time_s / o.interval)));
  o.initial_keyframe = imported->initial_keyframe;
  o.controls = &controls;
  auto probe = internal::MakeReduced(imported->scene, o);
  if (!probe) return tl::unexpected(probe.error());
  const auto tracked = internal::TrackedBodies(*probe);
  const auto full = [&](FullIntegrator integrator, int substeps) {
    o.full_integrator = integrator;
    o.substeps = substeps;
    return internal::RunFull(imported->scene, tracked, o);
  };
  const auto truth = full(FullIntegrator::kTwoStages, 32), before = full(FullIntegrator::kTwoStages, 16);
  if (!truth) return tl::unexpected(truth.error());
  if (!before) return tl::unexpected(before.error());
  StepOrderRow row;
  row.scene = name;
  row.time_s = o.samples * o.interval;
  const double motion = Apart(*truth, *truth, true);
  row.motion_mm = 1e3 * motion;
  row.truth_percent = 100 * Apart(*before, *truth) / motion;
  for (int i = 0; i < 2; ++i) {
    const int substeps = i == 0 ? 1 : 4;
    const auto euler = full(FullIntegrator::kEuler, substeps),
               two = full(FullIntegrator::kTwoStages, substeps);
    if (!euler) return tl::unexpected(euler.error());
    if (!two) return tl::unexpected(two.error());
    const auto two_stage = internal::RunReduced(imported->scene, tracked, o);
    if (!two_stage) return tl::unexpected(two_stage.error());
    row.two_stage_percent[i] = 100 * Apart(*two_stage, *truth) / motion;
    row.euler_percent[i] = 100 * Apart(*euler, *truth) / motion;
    row.two_percent[i] = 100 * Apart(*two, *truth) / motion;
    row.halved[i] = two->halved;
    row.steps[i] = static_cast<int>(two->step_s.size());
  }
  return row;
}

std::string StepOrderMarkdown(const std::vector<StepOrderRow>& rows) {
  std::string out =
      "| scene | motion | full, Euler 1/60 | full, two stages 1/60 | reduced, two stages 1/60 | full, "
      "Euler 1/240 | full, two stages 1/240 | reduced, two stages 1/240 | truth | steps halved at "
      "1/60, at 1/240 |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n";
  for (const StepOrderRow& r : rows) {
    out += fmt::format("| {}, {:.3g} s | {:.3g} mm |", r.scene, r.time_s, r.motion_mm);
    for (int i = 0; i < 2; ++i)
      out += fmt::format(" {:.3g} % | {:.3g} % | {:.3g} % |", r.euler_percent[i], r.two_percent[i],
                         r.two_stage_percent[i]);
    out += fmt::format(" {:.2g} % | {} of {}, {} of {} |\n", r.truth_percent, r.halved[0], r.steps[0],
                       r.halved[1], r.steps[1]);
  }
  return out;
}

}  // namespace fork1s
