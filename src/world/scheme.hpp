// The schemes of a step of length h: two stages, Alexander's SDIRK2, or one, backward Euler.
#pragma once

#include <numbers>

namespace fork1s {

enum class StageScheme { kFirstOfTwo, kSecondOfTwo, kBackwardEuler };

inline constexpr double kStageShare = 1 - 1 / std::numbers::sqrt2;  // γ: a stage of two has the length γ h
inline constexpr double kOnward =
    (1 - kStageShare) /
    kStageShare;  // s: the base point of the second is start + s (end of the first - start)

}  // namespace fork1s
