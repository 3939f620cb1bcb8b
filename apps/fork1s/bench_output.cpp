#include "bench_output.hpp"
#include "print.hpp"

#include <fmt/format.h>

#include <cmath>

namespace fork1s::app {
namespace {

Json Number(double v, bool known = true) { return known && std::isfinite(v) ? Json(v) : Json(nullptr); }

Json PeerJson(const PeerRow& row, const std::optional<double>& instructions) {
  Json out;
  out["step_us"] = Number(row.step_us, row.survived);
  out["ratio"] = Number(row.step_ratio, row.survived);
  out["error_percent"] = Number(row.error_percent, row.survived);
  out["rms_mm"] = Number(row.rms_mm, row.survived);
  out["step_instructions"] = Number(instructions.value_or(0), instructions.has_value());
  if (!row.survived) out["end"] = row.end;
  return out;
}

}  // namespace

Json SceneJson(const BenchScene& s, const std::string& controls) {
  const PeerRow& ours = s.rows.front();
  const auto instructions = s.Instructions("fork1s");
  Json out;
  out["integrator"] = NameOf(s.integrator);
  out["dt_s"] = ours.dt_s;
  out["simulated_s"] = ours.time_s;
  out["step_us"] = Number(ours.step_us);
  out["p99_us"] = Number(ours.p99_us);
  out["worst_us"] = Number(ours.worst_us);
  out["refreshes"] = ours.refreshes;
  out["refresh_step_us"] = Number(ours.refresh_step_us, ours.refreshes > 0);
  out["step_instructions"] = Number(instructions.value_or(0), instructions.has_value());
  out["controls"] = controls.empty() ? Json(nullptr) : Json(controls);
  out["error_percent"] = Number(ours.error_percent);
  out["rms_mm"] = Number(ours.rms_mm);
  out["truth_error_percent"] = Number(s.TruthErrorPercent());
  out["loop_gap_mm"] = Number(ours.loop_gap_mm, ours.has_loops);
  out["peers"] = Json::object();
  for (const PeerRow& row : s.rows)
    if (row.dt_s == ours.dt_s && &row != &ours)
      out["peers"][row.simulator] = PeerJson(row, s.Instructions(row.simulator));
  out["precision"] = Json::array();
  for (const PeerRow& row : s.rows)
    if (row.survived)
      out["precision"].push_back({{"simulator", row.simulator},
                                  {"dt_s", row.dt_s},
                                  {"us_per_simulated_s", row.step_us / row.dt_s},
                                  {"error_percent", Number(row.error_percent)},
                                  {"rms_mm", Number(row.rms_mm)}});
  if (!s.phases.empty()) {
    out["phases"] = out["phase_us"] = Json::object();
    for (const PhaseCost& p : s.phases) {
      out["phases"][p.phase] = Number(p.instructions.value_or(0), p.instructions.has_value());
      out["phase_us"][p.phase] = {{"median", Number(p.median_us.value_or(0), p.median_us.has_value())},
                                  {"mean", Number(p.mean_us.value_or(0), p.mean_us.has_value())}};
    }
  }
  if (!s.why_no_instructions.empty()) out["why_no_instructions"] = s.why_no_instructions;
  return out;
}

Json PartsJson(const BenchResults& results, Json out) {
  out["many"] = Json::array();
  for (const ManyCost& m : results.many)
    out["many"].push_back(
        {{"scene", m.scene}, {"instances", m.instances}, {"threads", m.threads}, {"step_us", m.step_us}});
  out["stability"] = Json::array();
  for (const BenchStability& s : results.stability)
    for (const StabilityRow& r : s.rows)
      out["stability"].push_back({{"scene", s.scene},
                                  {"simulator", r.simulator},
                                  {"stiffness_scale", r.stiffness_scale},
                                  {"largest_stable_dt_s", r.largest_stable_dt_s}});
  return out;
}

void PrintScene(const BenchScene& s) {
  const PeerRow& ours = s.rows.front();
  PrintText("{}, {:.3g} s at steps of {:.5g} s; {}\n", s.name, ours.time_s, ours.dt_s,
            std::isfinite(s.TruthErrorPercent())
                ? fmt::format("the truth is known to {:.2g} % of the motion", s.TruthErrorPercent())
                : "no interface or free body goes anywhere, so that errors have no percentage");
  PrintText("  {:<22} {:>10} {:>8} {:>10} {:>10} {:>12} {:>9} {:>10}\n", "", "us a step", "ratio",
            "99 % below", "worst", "instructions", "error, %", "error, mm");
  for (const PeerRow& r : s.rows) {
    if (r.dt_s != ours.dt_s) continue;
    if (!r.survived) {
      PrintText("  {:<22} {}\n", r.simulator, r.end);
      continue;
    }
    const auto instructions = s.Instructions(r.simulator);
    PrintText("  {:<22} {:>10.1f} {:>8.2f} {:>10.1f} {:>10.1f} {:>12} {:>9} {:>10.3g}\n", r.simulator,
              r.step_us, r.step_ratio, r.p99_us, r.worst_us,
              instructions ? fmt::format("{:.0f}", *instructions) : "-",
              std::isfinite(r.error_percent) ? fmt::format("{:.3g}", r.error_percent) : "-", r.rms_mm);
  }
  for (const PhaseCost& p : s.phases)
    PrintText("    {:<22} {:>9.3g} us {:>9.3g} us in the mean {:>12} instructions\n", p.phase,
              p.median_us.value_or(0), p.mean_us.value_or(0),
              p.instructions ? fmt::format("{:.0f}", *p.instructions) : "-");
  std::fflush(stdout);
}

void PrintParts(const BenchResults& results) {
  for (const BenchStability& s : results.stability) {
    PrintText("largest stable step of {}, stiffness times 1, 10, 100, 1000\n", s.scene);
    for (const StabilityRow& r : s.rows) {
      if (r.stiffness_scale != 1) continue;
      PrintText("  {:<22}", r.simulator);
      for (const StabilityRow& of_same : s.rows)
        if (of_same.simulator == r.simulator)
          PrintText(" {:>10}", of_same.largest_stable_dt_s > 0
                                   ? fmt::format("1/{:.0f}", 1 / of_same.largest_stable_dt_s)
                                   : "none");
      PrintText("\n");
    }
  }
  if (!results.many.empty()) PrintText("many at a time\n");
  for (const ManyCost& m : results.many)
    PrintText("  {} of {} on {}: {:.2f} us a step of one\n", m.instances, m.scene,
              m.threads == 1 ? "one thread" : fmt::format("{} threads", m.threads), m.step_us);
}

}  // namespace fork1s::app
