// How poses follow from reduced coordinates.
#pragma once

#include <optional>
#include <string_view>
#include <utility>

namespace fork1s {

/// How interface poses follow from z, and with them all others. The numbers stand in recordings and settings.
enum class Recovery {
  kExact = 0,   ///< product of exponentials, loops closed
  kTwist = 1,   ///< one exponential a body of the summed screws: the paper's parallel mode
  kCurved = 2,  ///< product of exponentials, loops closed to second order of what moved since the reference
  /// Steps by a second-order model of inertia, forces and interface poses about a pose
  /// (reduction/expansion.hpp), where a mechanism has one; poses as kExact.
  kExpanded = 3,
};
inline constexpr int kNumRecoveries = 4;

/// The words for them, in files and on the command line.
inline constexpr std::pair<Recovery, const char*> kRecoveryNames[] = {{Recovery::kExact, "exact"},
                                                                      {Recovery::kExpanded, "expanded"},
                                                                      {Recovery::kCurved, "curved"},
                                                                      {Recovery::kTwist, "twist"}};

constexpr const char* Name(Recovery recovery) {
  for (const auto& [value, name] : kRecoveryNames)
    if (value == recovery) return name;
  return "";
}

constexpr std::optional<Recovery> RecoveryNamed(std::string_view word) {
  for (const auto& [value, name] : kRecoveryNames)
    if (word == name) return value;
  return std::nullopt;
}

}  // namespace fork1s
