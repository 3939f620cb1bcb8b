// A model that is read in another process first, so that one that brings its reader down harms nobody.
#pragma once

#include <atomic>
#include <fork1s/base/error.hpp>
#include <string>

namespace fork1s::app {

/// Runs this very command once more with `--only-load`, until it ends or `stop` is set. Errors (kModel): it
/// crashed, was stopped, or did not end in two minutes. What is wrong with the file otherwise is for the
/// caller to find, safely now.
Expected<void> LoadApart(const std::string& path, const std::atomic<bool>& stop);

}  // namespace fork1s::app
