#include "gltf_meshes.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/geometry/surface.hpp>

namespace fork1s::internal {
namespace {

// glTF's colour factors are linear, those of models are meant for the screen (IEC 61966-2-1).
double Linear(double c) { return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4); }

template <class T>
void AppendBytes(const std::vector<T>& values, std::string& out) {
  out.append(reinterpret_cast<const char*>(values.data()), sizeof(T) * values.size());
}

const void* Shared(const Shape& shape) {
  if (const auto* mesh = std::get_if<MeshShape>(&shape)) return mesh->mesh.get();
  if (const auto* field = std::get_if<HeightField>(&shape)) return field->grid.get();
  return nullptr;
}

}  // namespace

int GltfMeshes::PrimitiveNumber(const Shape& shape, double plane_half) {
  const void* shared = Shared(shape);
  if (const auto known = by_mesh_.find(shared); shared && known != by_mesh_.end()) return known->second;
  const Surface surface = MakeSurface(shape, {.plane_half = plane_half});
  int number = -1;
  if (!surface.triangles.empty()) {
    for (const auto* values : {&surface.vertices, &surface.normals})
      for (const Eigen::Vector3f& v : *values) FORK1S_REQUIRE(v.allFinite(), ShapeName(shape), v.transpose());
    std::string bytes;
    AppendBytes(surface.vertices, bytes);
    AppendBytes(surface.normals, bytes);
    AppendBytes(surface.triangles, bytes);
    const auto [at, is_new] = by_bytes_.emplace(std::move(bytes), static_cast<int>(primitives_.size()));
    number = at->second;
    if (is_new)
      primitives_.push_back({document_.AddVertices(surface.vertices, true),
                             document_.AddVertices(surface.normals, false),
                             document_.AddTriangles(surface.triangles, surface.vertices.size())});
  }
  if (shared) by_mesh_[shared] = number;
  return number;
}

int GltfMeshes::Material(const Vector4& rgba) {
  std::array<double, 4> color;
  for (int k = 0; k < 4; ++k) {
    FORK1S_REQUIRE(std::isfinite(rgba(k)), rgba.transpose());
    const double value = std::clamp(rgba(k), 0.0, 1.0);
    color[static_cast<std::size_t>(k)] = k < 3 ? Linear(value) : value;
  }
  const auto known = materials_.find(color);
  if (known != materials_.end()) return known->second;
  GltfJson material = {{"pbrMetallicRoughness",
                        {{"baseColorFactor", color}, {"metallicFactor", 0.0}, {"roughnessFactor", 0.7}}}};
  if (color[3] < 1) material["alphaMode"] = "BLEND";
  return materials_[color] = document_.Add("materials", std::move(material));
}

std::optional<int> GltfMeshes::Mesh(const Shape& shape, const Vector4& rgba, double plane_half) {
  const int primitive = PrimitiveNumber(shape, plane_half);
  if (primitive < 0) return std::nullopt;
  const int material = Material(rgba);
  const auto known = meshes_.find({primitive, material});
  if (known != meshes_.end()) return known->second;
  const Primitive& p = primitives_[static_cast<std::size_t>(primitive)];
  GltfJson mesh;
  mesh["name"] = ShapeName(shape);
  GltfJson one;
  one["attributes"] = {{"POSITION", p.position}, {"NORMAL", p.normal}};
  one["indices"] = p.indices;
  one["material"] = material;
  mesh["primitives"].push_back(std::move(one));
  return meshes_[{primitive, material}] = document_.Add("meshes", std::move(mesh));
}

}  // namespace fork1s::internal
