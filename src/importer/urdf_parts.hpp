// The parts of URDF preparation: links, meshes.
#pragma once

#include <fmt/format.h>
#include <tinyxml2.h>

#include <map>
#include <set>
#include <string>
#include <vector>

#include "urdf.hpp"

namespace fork1s::internal {

/// What the preparation of one file gathers.
struct UrdfWork {
  std::string path;  // of the URDF
  PreparedUrdf out;
  std::map<std::string, std::string> mesh_names;                    // file and scale -> unique name
  std::map<std::string, Vector4> materials;                         // colours that have a name
  std::map<std::string, const tinyxml2::XMLElement*> parent_joint;  // link -> joint above it
  std::vector<std::string> massless, balanced, shaped, inferred, capsules, materials_dropped;
  std::map<std::string, std::vector<std::string>> visuals_dropped;  // by reason: link and file
  int next_material = 0;

  std::string Where(const tinyxml2::XMLElement& element) const {
    return fmt::format("{}, line {}", path, element.GetLineNum());
  }
  Error Refuse(ErrorCode code, const tinyxml2::XMLElement& element, std::string message) const {
    return {code, Where(element), std::move(message)};
  }
};

inline std::string NameOf(const tinyxml2::XMLElement& element) {
  const char* name = element.Attribute("name");
  return name != nullptr ? name : "";
}

/// Numbers of an attribute; as many as are there and are numbers.
std::vector<double> NumbersOf(const tinyxml2::XMLElement* element, const char* attribute);

/// Inertia, shapes and colours of one link.
std::optional<Error> PrepareLink(UrdfWork& work, tinyxml2::XMLElement& link);

/// Why a mesh cannot be used.
struct MeshFault {
  std::string reason;
  std::string remedy;
};

/// Finds the file of a <mesh> and gives it a name of its own.
std::optional<MeshFault> PrepareMesh(UrdfWork& work, tinyxml2::XMLElement& mesh);

}  // namespace fork1s::internal
