// A table of all models below a folder: which open, what they hold, what was dropped.
#pragma once

#include "model_arguments.hpp"

namespace fork1s::app {

/// `given`: the options for every file; its path is the folder. With time > 0 each model is also run for so long
/// [s]. Returns an exit code: kDone also where files are refused, which is what the table is there to tell.
int InspectFolder(const ModelArguments& given, double time);

}  // namespace fork1s::app
