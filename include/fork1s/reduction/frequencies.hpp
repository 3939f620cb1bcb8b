// Undamped natural frequencies of the unloaded mechanism and of its reduction.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>
#include <vector>

namespace fork1s {

/// Lowest `count` natural frequencies [Hz] of all coordinates at q, free motions left out; the base moves if
/// it floats.
std::vector<double> FullFrequencies(const Mechanism& mechanism, const VectorX& q, int count = 8);
/// The same within the reduced coordinates.
std::vector<double> ReducedFrequencies(const ReducedModel& model, int count = 8);

/// Vibrations of the condensed motions with all reduced coordinates held.
struct LeftOutModes {
  int count = 0;
  double lowest_hz = 0;  // 0: none
  double contribution_m =
      0;  // the largest of the lowest 24: displacement of the interface that is missed, to first
          // order, under the mechanism's weight on the interface at the worst frequency
  double largest_hz = 0;  // the mode that has it
};
LeftOutModes ComputeLeftOutModes(const ReducedModel& model);

}  // namespace fork1s
