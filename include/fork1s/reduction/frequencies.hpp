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

}  // namespace fork1s
