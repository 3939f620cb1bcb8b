// Tables of a benchmark, and the page that holds them.
#include "page.hpp"

#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "../html_page.hpp"
#include "../svg_plot.hpp"
#include "record/output_file.hpp"

namespace fork1s::internal {
namespace {

// Four digits; nothing where nothing was measured.
std::string Measured(double v, bool known = true) {
  return known && std::isfinite(v) ? fmt::format("{:.4g}", v) : "";
}

std::string Shown(double v, bool known = true) {
  const std::string text = Measured(v, known);
  return Cell(text.empty() ? std::string("-") : text);
}

std::string StepCell(double dt_s) { return Cell(fmt::format("1/{:.5g}", 1 / dt_s)); }

std::string SceneRows(const BenchScene& scene) {
  std::vector<std::string> rows;
  for (const PeerRow& r : scene.rows) {
    if (!r.survived) {
      rows.push_back(Cell(r.simulator) + StepCell(r.dt_s) + "<td colspan=\"8\">" + EscapeHtml(r.end) +
                     "</td>");
      continue;
    }
    const bool at_dt = r.dt_s == scene.rows.front().dt_s;
    const auto instructions = at_dt ? scene.Instructions(r.simulator) : std::nullopt;
    rows.push_back(Cell(r.simulator) + StepCell(r.dt_s) + Shown(r.step_us) + Shown(r.step_ratio) +
                   Shown(r.p99_us, at_dt) + Shown(r.worst_us, at_dt) +
                   Shown(1e-3 * instructions.value_or(0), instructions.has_value()) + Shown(r.error_percent) +
                   Shown(r.rms_mm) + Shown(r.loop_gap_mm, r.has_loops));
  }
  std::string out =
      Table(fmt::format("{}, {:.3g} s", scene.name, scene.rows.empty() ? 0 : scene.rows.front().time_s),
            {"", "step, s", "us a step", "over fork1s", "99 % below", "worst", "thousand instructions",
             "error, %", "error, mm", "loops open, mm"},
            rows);
  if (!scene.why_no_instructions.empty()) out += "<p>" + EscapeHtml(scene.why_no_instructions) + "</p>\n";
  rows.clear();
  for (const PhaseCost& p : scene.phases)
    rows.push_back(Cell(p.phase) + Shown(p.median_us.value_or(0), p.median_us.has_value()) +
                   Shown(p.mean_us.value_or(0), p.mean_us.has_value()) +
                   Shown(1e-3 * p.instructions.value_or(0), p.instructions.has_value()));
  return out + Table(scene.name + ", parts of a step",
                     {"", "us a step, median", "us a step, mean", "thousand instructions a step"}, rows);
}

std::string PhasesCsv(const BenchResults& results) {
  std::string out;
  for (const BenchScene& s : results.scenes)
    for (const PhaseCost& p : s.phases)
      out += fmt::format("{},\"{}\",{},{},{}\n", s.name, p.phase,
                         p.instructions ? fmt::format("{:.0f}", *p.instructions) : "",
                         Measured(p.median_us.value_or(0), p.median_us.has_value()),
                         Measured(p.mean_us.value_or(0), p.mean_us.has_value()));
  return out.empty() ? out : "scene,phase,instructions,median_us,mean_us\n" + out;
}

std::string ManyCsv(const BenchResults& results) {
  std::string out;
  for (const ManyCost& m : results.many)
    out += fmt::format("{},{},{},{:.4g}\n", m.scene, m.instances, m.threads, m.step_us);
  return out.empty() ? out : "scene,instances,threads,step_us\n" + out;
}

std::string StabilityCsv(const BenchResults& results) {
  std::string out;
  for (const BenchStability& s : results.stability)
    for (const StabilityRow& r : s.rows)
      out += fmt::format("{},\"{}\",{:g},{:.6g}\n", s.scene, r.simulator, r.stiffness_scale,
                         r.largest_stable_dt_s);
  return out.empty() ? out : "scene,simulator,stiffness_scale,largest_stable_dt_s\n" + out;
}

std::string ManyTable(const BenchResults& results) {
  std::vector<std::string> rows;
  for (const ManyCost& m : results.many)
    rows.push_back(Cell(m.scene) + Shown(m.instances) + Shown(m.threads) + Shown(m.step_us));
  return Table("Many at a time", {"", "instances", "threads", "us a step of one"}, rows);
}

}  // namespace

std::string BenchCsv(const BenchResults& results) {
  std::string out =
      "scene,simulator,dt_s,simulated_s,step_us,ratio,p99_us,worst_us,refreshes,refresh_step_us,step_"
      "instructions,error_percent,rms_mm,loop_gap_mm,end\n";
  for (const BenchScene& s : results.scenes)
    for (const PeerRow& r : s.rows) {
      const bool often = r.survived && r.dt_s == s.rows.front().dt_s;  // runs that were repeated
      const auto instructions =
          r.dt_s == s.rows.front().dt_s ? s.Instructions(r.simulator) : std::optional<double>();
      const bool refreshed = r.survived && r.simulator == "fork1s";
      out += fmt::format("{},\"{}\",{:.6g},{:.6g},{},{},{},{},{},{},{},{},{},{},\"{}\"\n", s.name,
                         r.simulator, r.dt_s, r.time_s, Measured(r.step_us, r.survived),
                         Measured(r.step_ratio, r.survived), Measured(r.p99_us, often),
                         Measured(r.worst_us, often), refreshed ? std::to_string(r.refreshes) : "",
                         Measured(r.refresh_step_us, refreshed && r.refreshes > 0),
                         instructions ? fmt::format("{:.0f}", *instructions) : "",
                         Measured(r.error_percent, r.survived), Measured(r.rms_mm, r.survived),
                         Measured(r.loop_gap_mm, r.survived && r.has_loops), r.end);
    }
  return out;
}

std::string BenchPage(const BenchResults& results) {
  std::string page = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>fork1s "
      "bench</title>\n"
      "<style>{}</style></head><body>\n<h1>fork1s bench</h1>\n<p>{}; {}. Times are medians of one run on one "
      "thread, all simulators in turn; ratios are worth more than times. Errors are distances from the "
      "converged "
      "full-coordinate run, as share of how far that moves.</p>\n",
      kPageStyle, EscapeHtml(results.when), EscapeHtml(results.machine));
  page += DrawPrecision(results);
  for (const BenchScene& s : results.scenes) page += SceneRows(s);
  return page + DrawStability(results) + ManyTable(results) + "</body></html>\n";
}

}  // namespace fork1s::internal

namespace fork1s {

Expected<void> WriteBench(const BenchResults& results, const std::string& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) return Fail(ErrorCode::kFile, folder, "cannot be made: " + failed.message());
  const auto csv = [&](const char* name, const std::string& text) -> Expected<void> {
    if (text.empty()) return {};
    return WriteFile(folder + "/" + name, {"a table of fork1s bench", text.substr(0, text.find(','))}, text);
  };
  const auto svg = [&](const char* name, const std::string& text) -> Expected<void> {
    if (text.empty()) return {};
    return WriteFile(folder + "/" + name, {"a plot", "<svg "}, text);
  };
  for (const auto& written :
       {results.scenes.empty() ? Expected<void>() : csv("bench.csv", internal::BenchCsv(results)),
        csv("bench_phases.csv", internal::PhasesCsv(results)),
        csv("bench_many.csv", internal::ManyCsv(results)),
        csv("bench_stability.csv", internal::StabilityCsv(results)),
        svg("bench_stability.svg", internal::DrawStability(results)),
        svg("bench_precision.svg", internal::DrawPrecision(results)),
        WriteFile(folder + "/bench.html", kHtmlFile, internal::BenchPage(results))})
    if (!written) return written;
  return {};
}

}  // namespace fork1s
