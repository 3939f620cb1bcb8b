// What the choice of interface bodies gains, as `inspect` and `reduce` tell it.
#pragma once

#include <optional>

#include "output.hpp"
#include "study/interface_gain.hpp"

namespace fork1s::app {

/// `gain` of one mechanism.
Json GainJson(const InterfaceGain& gain);
/// `step_us` of the whole scene; null where it was not measured.
Json StepTimesJson(const std::optional<StepTimes>& times);
/// "  gained: ..." from the JSON, a sentence a line.
void PrintGain(const Json& gain);
void PrintStepTimes(const Json& times);

}  // namespace fork1s::app
