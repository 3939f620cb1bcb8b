// Models that MuJoCo has compiled already, in a program that uses a library of the same version.
#pragma once

#include <fork1s/importer/importer.hpp>
#include <string>

struct mjModel_;  // mjModel of <mujoco/mujoco.h>

namespace fork1s {

/// The version of the MuJoCo library that reads models, such as "4.0.1".
std::string MujocoVersion();

/// The same as LoadMechanism of a model in memory, which is only read and may go afterwards. `name` stands
/// for the path in messages. A library of another version lays the structure out otherwise, and one that has
/// loaded other plugins counts them otherwise. Errors: kModel, kUsage.
Expected<ImportedScene> LoadMujocoModel(const mjModel_& model, const std::string& name,
                                        const ImportOptions& options = {});

}  // namespace fork1s
