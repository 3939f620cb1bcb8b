// A scene as it was read from a model file, with the notes of its reader, on its way from one process to another.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/importer/importer.hpp>
#include <string>

namespace fork1s {

/// Writes scene, report and initial keyframe to `path` as HDF5, every double to its last bit. Errors: kFile.
Expected<void> SaveImportedScene(const ImportedScene& imported, const std::string& path);

/// Reads a file of SaveImportedScene of the same version of this library. Errors: kFile (cannot be opened, or
/// does not fit into memory), kFormat.
Expected<ImportedScene> LoadImportedScene(const std::string& path);

}  // namespace fork1s
