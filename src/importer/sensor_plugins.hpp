// MJCF whose sensors are computed by plugins that this program does not have.
#pragma once

#include "prepared_model.hpp"

namespace fork1s::internal {

/// Gives the reader the files of the model without sensors of plugins and without the plugins that MuJoCo
/// does not know, each blanked so that lines keep their numbers; notes the sensors. `text`, of `path`, may be
/// empty: the file is read. Nothing changes where no sensor is of a plugin. Errors: kFile.
std::optional<Error> RemoveSensorPlugins(const std::string& path, const std::string& text,
                                         PreparedModel& prepared);

}  // namespace fork1s::internal
