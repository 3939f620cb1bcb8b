#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <lab/detail_levels.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/csv.hpp>

#include <fmt/format.h>

#include "base/percentile.hpp"
#include "study/runs.hpp"

namespace fork1s {
namespace {

using internal::Run;
using internal::RunOptions;
using internal::TrackedBody;

constexpr double kDetailStep = 1.0 / 60;  // s

std::string LevelText(const Fidelity& f) {
  std::string text = Name(f.level);
  if (f.modes >= 0) text += fmt::format(", {} modes", f.modes);
  if (f.recovery != Recovery::kExact) text += fmt::format(", {}", Name(f.recovery));
  return text;
}

int CountModes(const Simulation& simulation) {
  int modes = 0;
  for (const MechanismDynamics& m : simulation.world().mechanisms()) modes += m.model().num_modes;
  return modes;
}

// The level from `from` samples on, by itself: the shared runs do not tell a switch from a step.
Expected<DetailRow> Measure(const Scene& scene, const std::vector<TrackedBody>& tracked,
                            const RunOptions& options, int from, const Fidelity& level, const Run& truth) {
  auto made = internal::MakeReduced(scene, options);
  if (!made) return tl::unexpected(made.error());
  Simulation& s = *made;
  DetailRow row;
  row.fidelity = level;
  std::vector<double> step_us;
  double sum = 0, way = 0;
  int count = 0;
  using Clock = std::chrono::steady_clock;
  options.controls->Start(s);
  for (int i = 0; i < options.samples; ++i) {
    if (i == from) {
      const auto start = Clock::now();
      if (auto set = s.SetFidelity(level); !set) return tl::unexpected(set.error());
      row.switch_ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    }
    options.controls->Apply(s.time() + s.dt(), s);
    const auto start = Clock::now();
    const StepReport report = s.Step();
    const double us = std::chrono::duration<double, std::micro>(Clock::now() - start).count();
    if (!report.finite)
      return Fail(ErrorCode::kNumerics, "scene '" + scene.name + "'",
                  fmt::format("gave numbers that are not finite at {:.4g} s with detail '{}'", s.time(),
                              LevelText(level)));
    if (i < from) continue;
    step_us.push_back(us);
    row.refreshes += report.refreshes;
    row.joint_gap_mm = std::max(row.joint_gap_mm, 1e3 * s.JointGap());
    for (std::size_t k = 0; k < tracked.size(); ++k) {
      const Vector3& there = truth.samples[static_cast<std::size_t>(i) + 1].X_WB[k].translation();
      const double mm = 1e3 * (s.Pose(tracked[k].index).translation() - there).norm();
      row.max_mm = std::max(row.max_mm, mm);
      sum += mm * mm;
      way += 1e6 * (there - truth.samples[0].X_WB[k].translation()).squaredNorm();
      ++count;
    }
  }
  row.rms_mm = std::sqrt(sum / std::max(1, count));
  row.motion_mm = std::sqrt(way / std::max(1, count));
  row.step_us = Median(step_us);
  row.modes = CountModes(s);
  for (const MechanismDynamics& m : s.world().mechanisms()) {
    row.coordinates += m.num_velocities();
    row.interface_bodies += static_cast<int>(m.model().interfaces.size());
  }
  row.coordinates += 6 * static_cast<int>(s.world().free_bodies().size());
  return row;
}

}  // namespace

Expected<std::vector<DetailRow>> MeasureDetail(const std::string& folder, const std::string& name,
                                               double from_s, double time_s,
                                               const std::vector<Fidelity>& levels) {
  FORK1S_REQUIRE(from_s >= 0 && time_s > from_s, from_s, time_s);
  auto imported = LoadMechanism(folder + "/" + name + ".xml");
  if (!imported) return tl::unexpected(imported.error());
  ControlTrack controls;
  if (const std::string path = folder + "/" + name + ".csv"; std::filesystem::exists(path)) {
    auto read = ReadControls(path);
    if (!read) return tl::unexpected(read.error());
    controls = std::move(*read);
  }
  RunOptions o;
  o.interval = kDetailStep;
  o.samples = static_cast<int>(std::llround(time_s / kDetailStep));
  o.initial_keyframe = imported->initial_keyframe;
  o.controls = &controls;
  auto probe = internal::MakeReduced(imported->scene, o);
  if (!probe) return tl::unexpected(probe.error());
  std::vector<TrackedBody> tracked;
  for (std::size_t i = 0; i < probe->bodies().size(); ++i) {
    const SceneBody& b = probe->bodies()[i];
    if (b.is_interface || b.mechanism < 0) tracked.push_back({b.name, static_cast<int>(i), b.is_interface});
  }
  auto truth = internal::RunFull(imported->scene, tracked, o);
  if (!truth) return tl::unexpected(truth.error());
  std::vector<DetailRow> rows;
  for (const Fidelity& level : levels) {
    auto row = Measure(imported->scene, tracked, o, static_cast<int>(std::llround(from_s / kDetailStep)),
                       level, *truth);
    if (!row) return tl::unexpected(row.error());
    rows.push_back(*row);
  }
  return rows;
}

std::string DetailCsv(const std::string& scene, const std::vector<DetailRow>& rows) {
  std::string out =
      "scene,level,modes_asked,recovery,interface_bodies,modes,coordinates,switch_ms,step_us,rms_mm,max_mm,"
      "joint_gap_mm,motion_mm,refreshes\n";
  for (const DetailRow& r : rows)
    out += fmt::format("{},{},{},{},{},{},{},{:.4g},{:.4g},{:.4g},{:.4g},{:.4g},{:.4g},{}\n", scene,
                       Name(r.fidelity.level), r.fidelity.modes >= 0 ? std::to_string(r.fidelity.modes) : "",
                       Name(r.fidelity.recovery), r.interface_bodies, r.modes, r.coordinates, r.switch_ms,
                       r.step_us, r.rms_mm, r.max_mm, r.joint_gap_mm, r.motion_mm, r.refreshes);
  return out;
}

std::string DetailMarkdown(const std::vector<DetailRow>& rows) {
  std::string out =
      "| level | interface bodies | modes | coordinates | us a step | from full, RMS and max [mm] | joint "
      "gap at most "
      "[mm] | switched in [ms] |\n|---|---|---|---|---|---|---|---|\n";
  for (const DetailRow& r : rows)
    out += fmt::format("| {} | {} | {} | {} | {:.1f} | {:.3g}, {:.3g} | {:.2g} | {:.1f} |\n",
                       LevelText(r.fidelity), r.interface_bodies, r.modes, r.coordinates, r.step_us, r.rms_mm,
                       r.max_mm, r.joint_gap_mm, r.switch_ms);
  return out;
}

std::string RecoveryMarkdown(const std::vector<std::pair<std::string, std::vector<DetailRow>>>& scenes) {
  std::string out =
      "| scene | recovery | coordinates | us a step | refreshes | from full, RMS [% of the motion] | joint "
      "gap at "
      "most [mm] |\n|---|---|---|---|---|---|---|\n";
  for (const auto& [name, rows] : scenes)
    for (const DetailRow& r : rows)
      out +=
          fmt::format("| {} | {} | {} | {:.1f} | {} | {:.2g} | {:.2g} |\n", name, Name(r.fidelity.recovery),
                      r.coordinates, r.step_us, r.refreshes, 100 * r.rms_mm / r.motion_mm, r.joint_gap_mm);
  return out;
}

}  // namespace fork1s
