// Reduced models as HDF5 files, to be opened by h5py or MATLAB and by fork1s again.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>
#include <string>

namespace fork1s {

/// Writes every matrix of the model under the name that reduced_model.hpp gives it, with units and meaning as
/// attributes, and the mechanism's definition. T is [bodies x 6 x r], X_RB_ref [bodies x 4 x 4]. The file
/// appears when it is whole. Errors: kFile.
Expected<void> SaveReducedModel(const ReducedModel& model, const std::string& path);

/// Reads it back, the same to the last bit, with its mechanism rebuilt: ready for Configure and
/// RecoverPosesTwist. Errors: kFile, kFormat, and kModel where the definition cannot be built.
Expected<ReducedModel> LoadReducedModel(const std::string& path);

}  // namespace fork1s
