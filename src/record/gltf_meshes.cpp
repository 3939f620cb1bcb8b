#include "gltf_meshes.hpp"
#include "geometry/surface.hpp"
#include "record/png.hpp"

#include <algorithm>
#include <cmath>

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

int GltfMeshes::PrimitiveNumber(const GeometryDef& geometry, double plane_half) {
  const Shape& shape = geometry.shape;
  const void* shared = Shared(shape);
  const bool textured = geometry.picture != nullptr;
  if (const auto known = by_mesh_.find({shared, textured}); shared && known != by_mesh_.end())
    return known->second;
  Surface surface = MakeSurface(shape, {.plane_half = plane_half});
  if (!textured)
    surface.uv.clear();
  else if (std::holds_alternative<Plane>(shape))
    for (const Eigen::Vector3f& p : surface.vertices)
      surface.uv.emplace_back(static_cast<float>(geometry.picture_x) * p.x() - 0.5F,
                              -static_cast<float>(geometry.picture_y) * p.y() - 0.5F);
  int number = -1;
  if (!surface.triangles.empty()) {
    for (const auto* values : {&surface.vertices, &surface.normals})
      for (const Eigen::Vector3f& v : *values) FORK1S_REQUIRE(v.allFinite(), ShapeName(shape), v.transpose());
    std::string bytes;
    AppendBytes(surface.vertices, bytes);
    AppendBytes(surface.normals, bytes);
    AppendBytes(surface.triangles, bytes);
    for (const Eigen::Vector2f& uv : surface.uv)
      FORK1S_REQUIRE(uv.allFinite(), ShapeName(shape), uv.transpose());
    AppendBytes(surface.uv, bytes);
    const auto [at, is_new] = by_bytes_.emplace(std::move(bytes), static_cast<int>(primitives_.size()));
    number = at->second;
    if (is_new)
      primitives_.push_back({document_.AddVertices(surface.vertices, true),
                             document_.AddVertices(surface.normals, false),
                             document_.AddTriangles(surface.triangles, surface.vertices.size()),
                             surface.uv.empty() ? -1 : document_.AddTexturePlaces(surface.uv)});
  }
  if (shared) by_mesh_[{shared, textured}] = number;
  return number;
}

int GltfMeshes::Texture(const Picture& picture) {
  if (const auto known = textures_.find(&picture); known != textures_.end()) return known->second;
  const int image = document_.AddImage(picture.name, Png(picture));
  return textures_[&picture] = document_.Add("textures", {{"source", image}});  // repeats beyond its edges
}

int GltfMeshes::Material(const Vector4& rgba, const Picture* picture) {
  std::array<double, 4> color;
  for (int k = 0; k < 4; ++k) {
    FORK1S_REQUIRE(std::isfinite(rgba(k)), rgba.transpose());
    const double value = std::clamp(rgba(k), 0.0, 1.0);
    color[static_cast<std::size_t>(k)] = k < 3 ? Linear(value) : value;
  }
  const auto known = materials_.find({color, picture});
  if (known != materials_.end()) return known->second;
  GltfJson material = {{"pbrMetallicRoughness",
                        {{"baseColorFactor", color}, {"metallicFactor", 0.0}, {"roughnessFactor", 0.7}}}};
  if (picture) material["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", Texture(*picture)}};
  if (color[3] < 1) material["alphaMode"] = "BLEND";
  return materials_[{color, picture}] = document_.Add("materials", std::move(material));
}

std::optional<int> GltfMeshes::Mesh(const GeometryDef& geometry, double plane_half) {
  const int primitive = PrimitiveNumber(geometry, plane_half);
  if (primitive < 0) return std::nullopt;
  const bool textured = primitives_[static_cast<std::size_t>(primitive)].uv >= 0;
  const int material = Material(geometry.rgba, textured ? geometry.picture.get() : nullptr);
  const auto known = meshes_.find({primitive, material});
  if (known != meshes_.end()) return known->second;
  const Primitive& p = primitives_[static_cast<std::size_t>(primitive)];
  GltfJson mesh;
  mesh["name"] = ShapeName(geometry.shape);
  GltfJson one;
  one["attributes"] = {{"POSITION", p.position}, {"NORMAL", p.normal}};
  if (p.uv >= 0) one["attributes"]["TEXCOORD_0"] = p.uv;
  one["indices"] = p.indices;
  one["material"] = material;
  mesh["primitives"].push_back(std::move(one));
  return meshes_[{primitive, material}] = document_.Add("meshes", std::move(mesh));
}

}  // namespace fork1s::internal
