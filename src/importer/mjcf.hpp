// What was understood of a model file, as MJCF that MuJoCo opens.
#pragma once

#include <fork1s/importer/importer.hpp>
#include <map>
#include <string>

namespace fork1s {

struct MjcfModel {
  std::string text;
  /// Content of mesh files by name, for the folder of ModelAsMjcf. Other files stay where they are, and the
  /// text has their paths from where it will lie.
  std::map<std::string, std::string> meshes;
  ImportedScene imported;  ///< the model of which the text was made
  std::string start;       ///< keyframe of the text from which `imported` starts; empty: the reference
};

/// MJCF of a model with what the options change: base, poses, PD gains, interface, modes, ground. A URDF gets
/// its mimic joints as equalities, and its links do not touch their parents. The text will lie in `folder`,
/// its `meshes` in `mesh_folder`, a path from there. Errors: as of LoadMechanism; kUsage for options that
/// MJCF has no words for.
Expected<MjcfModel> ModelAsMjcf(const std::string& path, const ImportOptions& options,
                                const std::string& folder, const std::string& mesh_folder);

}  // namespace fork1s
