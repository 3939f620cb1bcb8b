#include <lab/peer_table.hpp>

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace fork1s {
namespace {

// Three digits, without exponents down to a thousandth.
std::string PeerDigits(double x) {
  if (x > 0 && x < 1e-3) return fmt::format("{:.0e}", x);
  const int places = x > 0 ? std::clamp(2 - static_cast<int>(std::floor(std::log10(x))), 0, 4) : 0;
  return fmt::format("{:.{}f}", x, places);
}

}  // namespace

std::vector<PeerEntrant> PeerTableEntrants(int fine_substeps) {
  using enum MuJoCoIntegrator;
  PeerEntrant euler{"fork1s euler"};
  euler.own_integrator = Integrator::kEuler;
  std::vector<PeerEntrant> entrants{{"fork1s"},
                                    euler,
                                    {"MuJoCo Euler", true, kEuler},
                                    {"MuJoCo implicitfast", true, kImplicitFast},
                                    {"MuJoCo discrete", true, kDiscrete},
                                    {"MuJoCo discrete, tuned", true, kDiscrete, true}};
  if (fine_substeps > 1) {
    entrants.push_back({"fork1s", false, kOfFile, false, fine_substeps});
    entrants.push_back({"MuJoCo Euler", true, kEuler, false, fine_substeps});
    entrants.push_back({"MuJoCo Euler, tuned", true, kEuler, true, fine_substeps});
  }
  return entrants;
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
    if (r.survived && r.has_loops && !r.simulator.starts_with("full"))
      out += fmt::format("{:.3g}", r.loop_turn_deg);
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
           : r.simulator.starts_with("full")
               ? PeerDigits(r.loop_gap_mm) + " |\n"
               : fmt::format("{}, {} |\n", PeerDigits(r.loop_gap_mm), PeerDigits(r.loop_turn_deg));
  }
  return out;
}

}  // namespace fork1s
