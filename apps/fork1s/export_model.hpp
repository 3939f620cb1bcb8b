// A model with its options, written as MJCF.
#pragma once

#include "model_arguments.hpp"

namespace fork1s::app {

/// Writes OUT.xml and its meshes, to the folder OUT_meshes beside it, and reads it again. Only an earlier
/// file of this function is replaced. Errors: as of ModelAsMjcf; kFile.
Expected<MjcfModel> WriteModel(const ModelArguments& model, const std::string& out);

}  // namespace fork1s::app
