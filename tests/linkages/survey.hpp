// One pass over many random linkages: what the plain method and the library say of each.
#pragma once

#include <string>
#include <vector>

namespace fork1s::linkages {

/// A linkage of the survey. Differences are relative.
struct Sample {
  unsigned seed = 0;
  std::string family;
  bool well_posed = false;
  double expected_error = 0, smallest_kept = 0, largest_dropped = 0;
  int coordinates = 0, loop_rank = 0, free = 0, elastic = 0, interface_free = 0, interface_rank = 0;
  int springs = 0;
  bool has_loops = false, overconstrained = false;

  double walk = 0, dense = 0;  // against the plain method
  int walk_rank = 0, dense_rank = 0;
  double walk_free = 0, dense_free = 0;  // distance of the spans of free directions
  double to_each_other = 0;              // as the library measures it
  std::string doubts;                    // that the library has, all of them

  bool refused = false;
  std::string refusal;     // the whole of it
  double named_share = 0;  // of the named joint in the hidden motions, 1 for the joint that moves most
  int model_loop_rank = 0, model_free = 0, model_elastic = 0;
  int frequencies = 0;

  int hidden() const { return free - interface_free; }
  /// Springs that no motion stretches.
  bool locked() const { return elastic == 0 && springs > 0; }
};

constexpr int kSurveyed = 3000;
/// Samples of the seeds 0 to kSurveyed - 1, taken once.
const std::vector<Sample>& TheSurvey();

}  // namespace fork1s::linkages
