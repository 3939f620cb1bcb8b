// A model with its options, written as MJCF for MuJoCo.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/importer/importer.hpp>
#include <memory>
#include <string>

#include "base/temporary_folder.hpp"
#include "importer/mjcf.hpp"

namespace fork1s {

/// Writes OUT.xml and its meshes, to the folder OUT_meshes beside it, and reads it again. Only an earlier
/// file of this function is replaced. Errors: as of ModelAsMjcf; kFile.
Expected<MjcfModel> WriteMjcfFile(const std::string& path, const ImportOptions& options,
                                  const std::string& out);

/// A model of a file as both simulators read it.
struct SharedModel {
  std::string path;                               // MJCF, for CompareOptions::model_path
  ImportedScene imported;                         // of that file
  std::shared_ptr<const TemporaryFolder> folder;  // of that file, where it had to be written
};

/// `imported` is what LoadMechanism reads of `path` with `options`. MuJoCo opens an MJCF file itself where the
/// options leave the model and its start to the file; a URDF, and an MJCF with other options, are written for
/// both to a temporary folder. Errors: as of WriteMjcfFile.
Expected<SharedModel> ShareWithMuJoCo(const std::string& path, const ImportOptions& options,
                                      ImportedScene imported);

}  // namespace fork1s
