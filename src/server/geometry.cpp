// Shapes, told once.
#include <algorithm>
#include <cmath>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "byte_writer.hpp"
#include "geometry/shape_sizes.hpp"
#include "geometry/surface.hpp"
#include "record/png.hpp"
#include "scene_description.hpp"
#include "server/wire.hpp"

namespace fork1s {
namespace {

using Json = nlohmann::json;

// Meshes, height grids and pictures in the order in which shapes first use them; shapes that share one share
// it here too.
struct MeshTable {
  std::map<const void*, int> numbers;
  std::vector<const TriangleMesh*> meshes;
  std::vector<std::shared_ptr<const TriangleMesh>> made;
  std::vector<const Picture*> pictures;
  std::set<const TriangleMesh*> pictured;  // those that show one: only they say where

  int Number(const TriangleMesh& mesh) { return Number(&mesh, mesh); }
  int Number(const void* key, const TriangleMesh& mesh) {
    const auto [at, is_new] = numbers.emplace(key, static_cast<int>(meshes.size()));
    if (is_new) meshes.push_back(&mesh);
    return at->second;
  }
  int Number(const HeightGrid& grid);
  int Number(const Picture& picture) {
    const auto at = std::find(pictures.begin(), pictures.end(), &picture) - pictures.begin();
    if (at == std::ssize(pictures)) pictures.push_back(&picture);
    return static_cast<int>(at);
  }
};

// A height grid becomes the triangles of its surface.
int MeshTable::Number(const HeightGrid& grid) {
  if (const auto at = numbers.find(&grid); at != numbers.end()) return at->second;
  auto mesh = std::make_shared<const TriangleMesh>(GridTriangles(grid));
  made.push_back(mesh);
  return Number(&grid, *mesh);
}

Json Numbers(const std::vector<double>& values) {
  Json out = Json::array();
  for (double v : values) out.push_back(std::isfinite(v) ? v : 0.0);
  return out;
}

void AddShape(const GeometryDef& g, MeshTable& meshes, Json& out) {
  const std::vector<double> sizes = internal::ShapeSizes(g.shape);
  if (!sizes.empty()) out["size"] = Numbers(sizes);
  const auto* mesh = std::get_if<MeshShape>(&g.shape);
  const auto* field = std::get_if<HeightField>(&g.shape);
  const bool is_plane = std::holds_alternative<Plane>(g.shape);
  if (mesh) out["mesh"] = meshes.Number(*mesh->mesh);
  if (field) out["mesh"] = meshes.Number(*field->grid);
  if (!g.picture || !(is_plane || (mesh && !mesh->mesh->corner_uv.empty()))) return;
  out["picture"] = meshes.Number(*g.picture);
  if (is_plane) out["repeat"] = Numbers({g.picture_x, g.picture_y});
  if (mesh) meshes.pictured.insert(mesh->mesh.get());
}

Json Collect(const Simulation& simulation, MeshTable& meshes) {
  Json shapes = Json::array();
  auto add = [&](int body, const std::vector<GeometryDef>& geometries) {
    for (const GeometryDef& g : geometries) {
      Json one;
      one["body"] = body;
      one["name"] = g.name;
      one["kind"] = ShapeName(g.shape);
      const Vector3& p = g.X_BG.translation();
      const Quaternion q = g.X_BG.quaternion();
      one["pose"] = Numbers({p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()});
      one["rgba"] = Numbers({g.rgba(0), g.rgba(1), g.rgba(2), g.rgba(3)});
      one["group"] = g.group;
      one["collides"] = g.Collides();
      AddShape(g, meshes, one);
      shapes.push_back(std::move(one));
    }
  };
  int body = 0;
  for (const MechanismDynamics& m : simulation.world().mechanisms())
    for (const BodyDef& b : m.mechanism().definition().bodies) add(body++, b.geometries);
  for (const FreeBodyDef& b : simulation.present_scene().free_bodies) add(body++, b.geometries);
  add(-1, simulation.scene().world);
  return shapes;
}

}  // namespace

std::string EncodeGeometry(const Simulation& simulation, std::uint32_t version) {
  MeshTable meshes;
  Json out;
  out["type"] = "geometry";
  out["version"] = version;
  out["shapes"] = Collect(simulation, meshes);
  out["meshes"] = meshes.meshes.size();
  return internal::Dump(out);
}

std::string EncodeMeshes(const Simulation& simulation) {
  MeshTable meshes;
  Collect(simulation, meshes);
  internal::ByteWriter out;
  out.U32(static_cast<std::uint32_t>(WireKind::kMeshes));
  out.U32(static_cast<std::uint32_t>(meshes.meshes.size()));
  for (const TriangleMesh* mesh : meshes.meshes) {
    out.U32(static_cast<std::uint32_t>(mesh->vertices.size()));
    out.U32(static_cast<std::uint32_t>(mesh->triangles.size()));
    const bool says_where = meshes.pictured.count(mesh) > 0;
    out.U32(says_where ? static_cast<std::uint32_t>(mesh->corner_uv.size()) : 0);
    for (const Eigen::Vector3f& v : mesh->vertices)
      for (int i = 0; i < 3; ++i) out.F32(static_cast<double>(v(i)));
    for (const Eigen::Vector3i& t : mesh->triangles)
      for (int i = 0; i < 3; ++i) out.U32(static_cast<std::uint32_t>(t(i)));
    if (!says_where) continue;
    for (const Eigen::Vector2f& uv : mesh->corner_uv)
      for (int i = 0; i < 2; ++i) out.F32(uv.allFinite() ? static_cast<double>(uv(i)) : 0);
  }
  out.U32(static_cast<std::uint32_t>(meshes.pictures.size()));
  for (const Picture* picture : meshes.pictures) {
    const std::string file = Png(*picture);
    out.U32(static_cast<std::uint32_t>(file.size()));
    out.Bytes(file);
  }
  return out.Release();
}

}  // namespace fork1s
