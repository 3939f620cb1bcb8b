// A model that is read in a process of its own: a file that crashes or stalls its reader, or makes it ask for too
// much memory, is an error and ends no session.
#pragma once

#include <atomic>
#include <fork1s/base/error.hpp>
#include <fork1s/importer/importer.hpp>

#include "model_arguments.hpp"

namespace fork1s::app {

/// First argument of the program that makes it a reader; those of ModelArguments follow.
inline constexpr const char* kReaderArgument = "--read-model";

/// Runs this program as reader of the model and returns what it read. The child may take half of the memory of the
/// machine, ModelArguments::read_time and 256 descriptors; it is killed once `stop` is set. Errors: those of
/// ModelArguments::Read; kModel where the reader crashed, met a limit or could not be started.
Expected<ImportedScene> ReadInChild(const ModelArguments& model, const std::atomic<bool>& stop);

/// The child of ReadInChild; `argv` begins at kReaderArgument. Returns its exit code.
int RunReader(int argc, char** argv);

}  // namespace fork1s::app
