// What ./demo shows: a hand grasps a box, lifts it, is shaken and holds; on slippery skin it drops it.
//
//     hand_demo [SCENE.xml [CONTROLS.csv]]     the second is written: the set-points of every step
#include <fmt/format.h>

#include <algorithm>

#include "hand_scenario.hpp"

namespace {

using fork1s::examples::HandMeasurement;
using fork1s::examples::HandScenario;

bool all_as_promised = true;

void Row(const char* what, const std::string& value, const char* promise = "", bool kept = true) {
  fmt::print("  {:<44} {:>16}   {:<22}{}\n", what, value, promise, *promise ? (kept ? "yes" : "NO") : "");
  all_as_promised = all_as_promised && kept;
}

double Percentile(std::vector<double> values, double p) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[static_cast<std::size_t>(p * static_cast<double>(values.size() - 1))];
}

}  // namespace

int main(int argc, char** argv) {
  const std::string scene = argc > 1 ? argv[1] : FORK1S_SCENES "/hand.xml";
  HandScenario grasp;
  if (argc > 2) grasp.controls_csv = argv[2];
  const auto held = RunHandScenario(scene, grasp);
  HandScenario slippery;
  slippery.friction = 0.2;
  slippery.shake = false;
  slippery.rest = 0;
  const auto dropped = RunHandScenario(scene, slippery);
  for (const auto* run : {&held, &dropped})
    if (!*run) {
      fmt::print(stderr, "{}\n", run->error().Text());
      return 3;
    }
  const HandMeasurement& m = *held;
  fmt::print("A hand of 20 joints takes a box of 0.2 kg at 60 steps a second.\n\n");
  fmt::print("  {:<44} {:>16}   {:<22}{}\n", "", "measured", "promised", "kept");
  Row("steps", fmt::format("{}", m.steps));
  Row("time a step, median", fmt::format("{:.1f} us", Percentile(m.step_us, 0.5)));
  Row("time a step, 99th percentile", fmt::format("{:.1f} us", Percentile(m.step_us, 0.99)));
  Row("times real time", fmt::format("{:.0f}", 1e6 / 60 / Percentile(m.step_us, 0.5)));
  Row("contacts, most at once", fmt::format("{}", m.contacts_max));
  Row("penetration, most", fmt::format("{:.3f} mm", 1e3 * m.penetration_max), "< 0.5 mm",
      m.penetration_max < 5e-4);
  Row("refreshes of the reduced model", fmt::format("{}", m.refreshes));
  Row("lifted by", fmt::format("{:.1f} mm", 1e3 * m.lift_height), "> 140 mm", m.lift_height > 0.14);
  Row("sways in the grip while shaken, 20 mm at 3 Hz", fmt::format("{:.3f} mm", 1e3 * m.sway_in_shake));
  Row("slipped by the shaking", fmt::format("{:.3f} mm", 1e3 * m.slip_by_shake), "< 1 mm",
      m.slip_by_shake < fork1s::examples::kHandSlip);
  Row("grip force of the thumb", fmt::format("{:.2f} N", m.grip_force));
  Row("load carried against the weight, off by", fmt::format("{:.1e}", m.load_error), "< 1e-3",
      m.load_error < 1e-3);
  Row("drift in 5 s of rest", fmt::format("{:.5f} mm", 1e3 * m.drift_at_rest), "< 0.01 mm",
      m.drift_at_rest < 1e-5);
  Row("contact solves not converged, at rest", fmt::format("{}", m.unconverged_rest), "0",
      m.unconverged_rest == 0);
  Row("contact solves not converged, before", fmt::format("{}", m.unconverged_closing));
  Row("friction 0.2 instead of 0.8: left behind by",
      fmt::format("{:.1f} mm", 1e3 * (0.15 - dropped->lift_height)), "> 100 mm",
      0.15 - dropped->lift_height > 0.1);
  fmt::print("\n{}\n",
             all_as_promised ? "Everything is as promised." : "Something is not as promised: see NO above.");
  return all_as_promised ? 0 : 1;
}
