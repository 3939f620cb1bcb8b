// A model file made fit for MuJoCo's reader, and its conversion.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "conversion.hpp"
#include "urdf.hpp"

namespace fork1s::internal {

/// MJCF as it stands, or a URDF rewritten.
struct PreparedModel : PreparedUrdf {
  bool is_urdf = false;
};

/// Reads and checks the file. Errors as of LoadMechanism.
Expected<PreparedModel> PrepareModel(const std::string& path, const ImportOptions& options);

/// The elements that MuJoCo reads from it, with the extensions of a URDF. Errors as of EditableModel::Parse.
Expected<EditableModel> ParsePrepared(const PreparedModel& prepared);

/// Convert of the compiled `prepared`, with its notes and those of the compiler. Errors as of LoadMechanism.
std::optional<Error> ConvertPrepared(Conversion& c, const PreparedModel& prepared,
                                     const std::vector<std::string>& warnings, const ImportOptions& options);

}  // namespace fork1s::internal
