// Mesh files of other programs, read and checked before the engine sees them.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/base/types.hpp>
#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <vector>

namespace fork1s::internal {

/// Why a mesh cannot be used. kFile: it cannot be read; kFormat: damaged or of an unknown kind; kModel: read,
/// but no shape that can touch.
struct MeshFault {
  ErrorCode code = ErrorCode::kModel;
  std::string reason, remedy;
};

/// Triangles [m] with their vertices, each place once.
struct MeshData {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3i> triangles;
};

/// Whether ReadMeshFile knows files of that name: .dae, .obj, .stl, .glb.
bool IsKnownMesh(const std::string& path);

/// All objects of the file as one mesh: transforms of its scene and the unit of a COLLADA file applied, axes
/// as they are written (RViz and MoveIt do not turn them either), then times `scale`. Every vertex is finite,
/// every index in range, and the whole has a volume, so that it has a hull.
tl::expected<MeshData, MeshFault> ReadMeshFile(const std::string& path, const Vector3& scale);

/// The same as a Wavefront file, every number with all its digits.
std::string WriteObj(const MeshData& mesh);

/// A Wavefront file with its vertices and faces alone, written so that Assimp 5.2 reads them right: of a
/// coordinate such as .1 or +1 it would lose the vertex, and number all that follow wrongly. Damage is
/// refused with its line.
tl::expected<std::string, MeshFault> CleanObj(const std::string& content);
/// A COLLADA file as it was understood when it was checked, so that the reader sees the same. Damage is
/// refused with its line.
tl::expected<std::string, MeshFault> CleanDae(const std::string& content);
/// Damage that is seen in the bytes: the reader takes part of it on trust, and drops some silently.
std::optional<MeshFault> FindStlDamage(const std::string& content);
std::optional<MeshFault> FindGlbDamage(const std::string& content);
/// Bytes that belong to a binary STL; nothing for text.
std::optional<std::size_t> BinaryStlSize(const std::string& content);

}  // namespace fork1s::internal
