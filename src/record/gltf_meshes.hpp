#pragma once

#include <fork1s/mechanism/definition.hpp>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "gltf_document.hpp"

namespace fork1s::internal {

/// Meshes and materials of a document, each written once however many shapes are alike.
class GltfMeshes {
 public:
  explicit GltfMeshes(GltfDocument& document) : document_(document) {}

  /// Number of the mesh that shows a shape in its colour and with its picture; none for shapes without
  /// triangles. `plane_half` [m] is half the side of planes without end.
  /// Throws std::invalid_argument for shapes that cannot be drawn.
  std::optional<int> Mesh(const GeometryDef& geometry, double plane_half);

 private:
  struct Primitive {
    int position = 0, normal = 0, indices = 0, uv = -1;  // accessors
  };
  int PrimitiveNumber(const GeometryDef& geometry, double plane_half);  // -1: no triangles
  int Material(const Vector4& rgba, const Picture* picture);
  int Texture(const Picture& picture);

  GltfDocument& document_;
  std::vector<Primitive> primitives_;
  std::map<std::string, int> by_bytes_;  // numbers of primitives by the bytes of their surface
  std::map<std::pair<const void*, bool>, int> by_mesh_;  // and of shared meshes and grids, with uv or not
  std::map<std::pair<std::array<double, 4>, const Picture*>, int> materials_;
  std::map<const Picture*, int> textures_;
  std::map<std::pair<int, int>, int> meshes_;  // of primitive and material
};

}  // namespace fork1s::internal
