// What takes the place of MuJoCo's own routines for pairs of shapes, in models of ours.
// docs/contact_detection.md has the figures.
#pragma once

#include <mujoco/mujoco.h>

namespace fork1s::internal {

/// Name of the models that this applies to; those of others stay with MuJoCo's own routines.
inline constexpr const char* kCollisionModelName = "fork1s_collision";

/// Puts our routines into MuJoCo's table, once.
void InstallPairRoutines();

/// How such a model is to be searched; `multi_point`: all corners of the overlap
/// where flat shapes rest on each other.
void SetPairOptions(mjModel& model, bool multi_point);

}  // namespace fork1s::internal
