// URDF made fit for MuJoCo's reader, which skips, merges or stumbles over part of what URDF allows.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "conversion.hpp"
#include "mujoco_model.hpp"
#include "urdf_extensions.hpp"

namespace fork1s::internal {

/// Mass (kg) and moments (kg·m²) given to links without any, which MuJoCo refuses.
inline constexpr double kMasslessUrdf = 1e-14;
/// Whether a mass or moment counts as 0: those given, however they were rounded on their way.
inline bool IsMasslessUrdf(double value) { return value <= 2 * kMasslessUrdf; }

struct PreparedUrdf {
  ModelSource source;  // rewritten text and mesh files under unique names
  std::vector<ImportNote> notes;
  std::vector<Mimic> mimics;
  UrdfExtensions extensions;
  std::map<std::string, double> velocity_limits;  // as of ImportReport
};

/// Errors: kFormat for joint types and shapes that URDF does not have and for damaged meshes, kModel for
/// missing meshes, unknown links and impossible inertia, kUsage for packages that are no folder; all with
/// line, name and remedy.
Expected<PreparedUrdf> PrepareUrdf(const std::string& path, const std::string& text,
                                   const ImportOptions& options);

}  // namespace fork1s::internal
