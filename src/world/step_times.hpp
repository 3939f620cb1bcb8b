// How long the parts of a step took.
#pragma once

#include <array>
#include <utility>

namespace fork1s {

/// Seconds by the wall clock, of one step: World::Watch. Parts follow each other, on however many threads
/// each.
struct StepPartTimes {
  double finding = 0;          // contacts
  double rows = 0;             // of contacts and stops, with what is known of them from the last step
  double free_velocities = 0;  // before contact
  double solving = 0;          // contacts, stops and dry friction, with the mobility that they need
  double moving = 0;           // coordinates, loops, poses
  double refreshing = 0;       // relinearizations: of the loop that moves mechanisms, their share
  double all = 0;
};

/// By name, in the order of a step; they add up to `all`.
inline std::array<std::pair<const char*, double>, 7> PartsOf(const StepPartTimes& t) {
  const double rest = t.all - t.finding - t.rows - t.free_velocities - t.solving - t.moving - t.refreshing;
  return {{{"finding contacts", t.finding},
           {"rows of contact", t.rows},
           {"free velocities", t.free_velocities},
           {"solving contacts", t.solving},
           {"moving, poses, loops", t.moving},
           {"refreshing", t.refreshing},
           {"the rest", rest}}};
}

}  // namespace fork1s
