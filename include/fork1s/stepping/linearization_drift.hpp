// Why a reduction is computed again about the present pose (docs/method.md, Relinearization).
#pragma once

namespace fork1s {

enum class DriftCause { kTurnedJoint, kMissingLoad, kLoopGap };
/// In files, on the command line and in Python, by cause.
inline constexpr const char* kDriftCauseNames[] = {"turned_joint", "missing_load", "loop_gap"};

struct LinearizationDrift {
  DriftCause cause = DriftCause::kTurnedJoint;
  double share = 0;      // of what the cause is bounded by; beyond 1 a new reference is due
  double amount = 0;     // rad or m: joint displacement since the reference, displacement missing, or gap
  bool is_angle = true;  // amount is in rad
  int coordinate = -1;   // that turned furthest, or whose displacement is missing most; -1: none
};

}  // namespace fork1s
