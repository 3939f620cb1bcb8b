// Models that MuJoCo has compiled already, by whoever links the same MuJoCo.
#pragma once

#include <fork1s/importer/importer.hpp>
#include <string>

struct mjModel_;  // mjModel of <mujoco/mujoco.h>

namespace fork1s {

/// The same as LoadMechanism of a model in memory, which is only read and may go afterwards. `name` stands
/// for the path in messages. Errors: kModel, kUsage.
Expected<ImportedScene> LoadMujocoModel(const mjModel_& model, const std::string& name,
                                        const ImportOptions& options = {});

}  // namespace fork1s
