// A model that is read in another process first, so that one that brings its reader down harms nobody.
#pragma once

#include <atomic>
#include <fork1s/base/error.hpp>
#include <string>
#include <vector>

#include "model_arguments.hpp"

namespace fork1s::app {

/// Runs `fork1s view --only-load` on the model, with further `options` of view, until it ends or `stop` is
/// set. Errors: those that reading the model ends with; kModel where the reader crashed, was stopped, did not
/// end in two minutes or could not be started. Without an error the model can be read in this process.
Expected<void> LoadApart(const ModelArguments& model, const std::vector<std::string>& options,
                         const std::atomic<bool>& stop);

}  // namespace fork1s::app
