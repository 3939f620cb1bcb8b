// What the parts of a step take.
#pragma once

#include <string>

#include "study/bench.hpp"

namespace fork1s::internal {

/// The row of a part in scene.phases, added where there is none.
PhaseCost& PhaseOf(BenchScene& scene, const std::string& phase);

/// Runs the scene with clocks between the parts of its steps: times of scene.phases. Runs of their own, since
/// reading clocks takes a small step some percent longer.
Expected<void> TimePhases(const BenchOptions& options, const ControlTrack& controls, double dt,
                          BenchScene& scene);

}  // namespace fork1s::internal
