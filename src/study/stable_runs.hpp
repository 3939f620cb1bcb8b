// Which runs are stable, and the largest step at which one is.
#pragma once

#include <functional>
#include <optional>

#include "runs.hpp"

namespace fork1s::internal {

inline constexpr double kLargestStep = 1.0 / 60;  // s, which is also the interval between samples
inline constexpr int kHalvings = 8;               // of the largest step, to 1/15360 s

/// Whether a run keeps to what study/stability.hpp says of stable ones, beside a reference that is
/// sampled at the same times. Not so where a number is not finite.
bool IsStable(const Run& run, const Run& reference);

/// The first stable run of simulate(k), k = 0 to kHalvings, with steps of kLargestStep / 2^k; none if no run
/// is. A run that ends with kNumerics is not stable. Errors: others of `simulate`.
Expected<std::optional<Run>> FirstStable(const Run& reference,
                                         const std::function<Expected<Run>(int halvings)>& simulate);

}  // namespace fork1s::internal
