// The parts of URDF preparation: links, inertia, meshes.
#pragma once

#include <fmt/format.h>
#include <tinyxml2.h>

#include <map>
#include <set>
#include <string>
#include <vector>

#include "mesh_file.hpp"
#include "package_search.hpp"
#include "urdf.hpp"

namespace fork1s::internal {

/// A mesh file under the name that the engine knows it by, or why it cannot be used.
struct PreparedMesh {
  std::string name;
  std::optional<MeshFault> fault;
};

/// What the preparation of one file gathers.
struct UrdfWork {
  std::string path;  // of the URDF
  PreparedUrdf out;
  FileSearch search;
  std::map<std::string, PreparedMesh> meshes;                       // by file and scale
  std::map<std::string, Vector3> mesh_extents;                      // m, by unique name
  std::set<std::string> packages;                                   // that meshes name
  std::map<std::string, Vector4> materials;                         // colours that have a name
  std::map<std::string, const tinyxml2::XMLElement*> parent_joint;  // link -> joint above it
  std::vector<std::string> massless, weightless, balanced, rounded, points, inferred, capsules,
      materials_dropped;
  std::map<std::string, std::vector<std::string>> shaped;           // links by the shape that gave inertia
  std::map<std::string, std::vector<std::string>> shapes_dropped;   // links by what was wrong
  std::map<std::string, std::vector<std::string>> visuals_dropped;  // by reason: link and file
  std::vector<const tinyxml2::XMLElement*> mujoco_options;          // <option> of <mujoco>
  int next_material = 0;

  std::string Where(const tinyxml2::XMLElement& element) const {
    return fmt::format("{}, line {}", path, element.GetLineNum());
  }
  Error Refuse(ErrorCode code, const tinyxml2::XMLElement& element, std::string message) const {
    return {code, Where(element), std::move(message)};
  }
  /// Refuses an attribute that is there and is no number.
  std::optional<Error> CheckNumber(const tinyxml2::XMLElement* element, const char* attribute,
                                   const std::string& link) const;
};

inline std::string NameOf(const tinyxml2::XMLElement& element) {
  const char* name = element.Attribute("name");
  return name != nullptr ? name : "";
}

/// Numbers of an attribute; as many as are there and are numbers.
std::vector<double> NumbersOf(const tinyxml2::XMLElement* element, const char* attribute);

/// A frame by the attributes `xyz` [m] and `rpy` [rad], as URDF's <origin> gives it; the identity without.
RigidTransform PoseOf(const tinyxml2::XMLElement* element);

/// Whether a word is one number and nothing else.
bool IsNumber(const std::string& word);

/// The first of them; 0 without.
double NumberOf(const tinyxml2::XMLElement* element, const char* attribute);
/// With all its digits.
std::string NumberText(double value);

/// Shapes, colours and inertia of one link.
std::optional<Error> PrepareLink(UrdfWork& work, tinyxml2::XMLElement& link);

/// Mass and inertia of one link whose shapes are prepared (urdf_inertia.cpp).
std::optional<Error> PrepareInertia(UrdfWork& work, tinyxml2::XMLElement& link);

/// Finds the file of a <mesh>, reads it and gives it a name of its own.
std::optional<MeshFault> PrepareMesh(UrdfWork& work, tinyxml2::XMLElement& mesh);

/// Counts elements and attributes of `e` and below that nothing reads (urdf_unread.cpp), by "<limit> in <joint>" and
/// "effort= in <limit>". Elements that stand a second time where one is read are counted and taken away.
void CountUnread(tinyxml2::XMLElement& e, std::map<std::string, int>& unread);
/// Attributes of `e` beside those.
void CountUnreadAttributes(const tinyxml2::XMLElement& e, const std::set<std::string>& read,
                           std::map<std::string, int>& unread);

}  // namespace fork1s::internal
