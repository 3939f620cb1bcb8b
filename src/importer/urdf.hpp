// URDF made fit for MuJoCo's reader, which skips, merges or stumbles over part of what URDF allows.
#pragma once

#include <string>
#include <vector>

#include "conversion.hpp"
#include "mujoco_model.hpp"

namespace fork1s::internal {

struct PreparedUrdf {
  ModelSource source;  // rewritten text and mesh files under unique names
  std::vector<ImportNote> notes;
  std::vector<Mimic> mimics;
};

/// Errors: kFormat for joint types and shapes that URDF does not have, kModel for missing meshes, unknown
/// links and impossible inertia; all with line, name and remedy.
Expected<PreparedUrdf> PrepareUrdf(const std::string& path, const std::string& text, bool floating);

}  // namespace fork1s::internal
