// What ./demo shows: a hand grasps a box, lifts it, is shaken and holds; on slippery skin it drops it.
//
//     hand_demo [SCENE.xml [CONTROLS.csv]]     the second is written: the set-points of every step
#include <fmt/format.h>

#include "hand_scenario.hpp"

int main(int argc, char** argv) {
  using namespace fork1s::examples;
  const std::string scene = argc > 1 ? argv[1] : FORK1S_SCENES "/hand.xml";
  HandScenario grasp;
  if (argc > 2) grasp.controls_csv = argv[2];
  const auto held = RunHandScenario(scene, grasp), dropped = RunHandScenario(scene, SlipperyHand());
  for (const auto* run : {&held, &dropped})
    if (!*run) {
      fmt::print(stderr, "{}\n", run->error().Text());
      return 3;
    }
  fmt::print("A hand of 20 joints takes a box of 0.2 kg at 60 steps a second.\n\n");
  fmt::print("  {:<44} {:>16}   {:<22}{}\n", "", "measured", "promised", "kept");
  bool all_kept = true;
  for (const HandRow& row : HandTable(*held, *dropped)) {
    const char* kept = row.promise.empty() ? "" : row.kept ? "yes" : "NO";
    fmt::print("  {:<44} {:>16}   {:<22}{}\n", row.what, row.measured, row.promise, kept);
    all_kept = all_kept && row.kept;
  }
  fmt::print("\n{}\n",
             all_kept ? "Everything is as promised." : "Something is not as promised: see NO above.");
  return all_kept ? 0 : 1;
}
