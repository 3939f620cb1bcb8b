// What `view` keeps in a copy of the model's file: tuned numbers and moments.
#pragma once

#include <atomic>

#include "model_arguments.hpp"
#include "server/model_file.hpp"

namespace fork1s::app {

/// Writes copies beside the file, never over one that is there, and reads each again: what it then does not
/// say is told. The file and its copy are read in a child process first, until it ends or `stop` is set.
ModelFile FileOf(const ModelArguments& model, const ImportReport& report, const std::atomic<bool>& stop);

}  // namespace fork1s::app
