// The argument of `run --accuracy`, and what was tried for it as JSON and text.
#pragma once

#include <string>

#include "output.hpp"
#include "study/accuracy_choice.hpp"

namespace fork1s::app {

/// "0.5mm", "2e-4m", "1%". Errors: kUsage.
Expected<WantedAccuracy> ParseAccuracy(const std::string& text);

/// The key `accuracy` of run's JSON.
Json AccuracyJson(const std::string& asked, const AccuracyChoice& choice);
/// The lines that `run` prints for it.
void PrintAccuracy(const Json& accuracy);

}  // namespace fork1s::app
