// A ModelText as a group of an HDF5 file: JSON as text, meshes and height grids as arrays.
#pragma once

#include "record/scene_json.hpp"

#include "hdf5_file.hpp"

namespace fork1s::internal {

void WriteModel(hid_t group, const ModelText& text);
/// Throws Hdf5Fault, also where the content does not match its checksum.
ModelText ReadModel(hid_t group, std::size_t file_size);

}  // namespace fork1s::internal
