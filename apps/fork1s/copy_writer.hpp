// What `view` keeps in a copy of the model's file: tuned numbers and moments.
#pragma once

#include <fork1s/server/model_file.hpp>

#include "model_arguments.hpp"

namespace fork1s::app {

/// Writes copies beside the file, never over one that is there, and reads each again: what it then does not
/// say is told.
ModelFile FileOf(const ModelArguments& model, const ImportReport& report);

}  // namespace fork1s::app
