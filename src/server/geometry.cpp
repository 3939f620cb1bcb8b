// Shapes, told once.
#include <algorithm>
#include <cmath>
#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/geometry/surface.hpp>
#include <fork1s/server/wire.hpp>
#include <map>
#include <nlohmann/json.hpp>

#include "byte_writer.hpp"
#include "scene_description.hpp"

namespace fork1s {
namespace {

using Json = nlohmann::json;

// Meshes and height grids in the order in which shapes first use them; shapes that share one, and its
// picture, share it here too.
struct MeshTable {
  struct Entry {
    const TriangleMesh* mesh;
    const Picture* picture;
  };
  std::map<std::pair<const void*, const Picture*>, int> numbers;
  std::vector<Entry> meshes;
  std::vector<std::shared_ptr<const TriangleMesh>> made;

  int Number(const TriangleMesh& mesh, const Picture* picture) {
    return Number(&mesh, mesh, mesh.corner_uv.empty() ? nullptr : picture);
  }
  int Number(const void* key, const TriangleMesh& mesh, const Picture* picture) {
    const auto [at, is_new] = numbers.emplace(std::pair(key, picture), static_cast<int>(meshes.size()));
    if (is_new) meshes.push_back({&mesh, picture});
    return at->second;
  }
  int Number(const HeightGrid& grid);
};

// A height grid becomes the triangles of its surface.
int MeshTable::Number(const HeightGrid& grid) {
  if (const auto at = numbers.find({&grid, nullptr}); at != numbers.end()) return at->second;
  auto mesh = std::make_shared<const TriangleMesh>(GridTriangles(grid));
  made.push_back(mesh);
  return Number(&grid, *mesh, nullptr);
}

Json Numbers(std::initializer_list<double> values) {
  Json out = Json::array();
  for (double v : values) out.push_back(std::isfinite(v) ? v : 0.0);
  return out;
}

struct SizeOf {
  Json& out;
  MeshTable& meshes;
  const Picture* picture;
  void operator()(const Plane& s) const { out["size"] = Numbers({s.half_x, s.half_y}); }
  void operator()(const Sphere& s) const { out["size"] = Numbers({s.radius}); }
  void operator()(const Capsule& s) const { out["size"] = Numbers({s.radius, s.half_length}); }
  void operator()(const Cylinder& s) const { out["size"] = Numbers({s.radius, s.half_length}); }
  void operator()(const Ellipsoid& s) const {
    out["size"] = Numbers({s.radii.x(), s.radii.y(), s.radii.z()});
  }
  void operator()(const Box& s) const { out["size"] = Numbers({s.half.x(), s.half.y(), s.half.z()}); }
  void operator()(const MeshShape& s) const { out["mesh"] = meshes.Number(*s.mesh, picture); }
  void operator()(const HeightField& s) const { out["mesh"] = meshes.Number(*s.grid); }
};

// The page has no pictures, but colours of corners: that of the picture a quarter of the way to the middle of
// the triangle, since what a corner touches is often the next piece of an atlas.
void CornerColours(const TriangleMesh& mesh, const Picture& picture, internal::ByteWriter& out) {
  const auto place = [](float at, int size) {
    const float wrapped = at - std::floor(at);
    return static_cast<std::size_t>(
        std::clamp(static_cast<int>(wrapped * static_cast<float>(size)), 0, size - 1));
  };
  for (std::size_t t = 0; t < mesh.corner_uv.size() / 3; ++t) {
    const Eigen::Vector2f *corners = &mesh.corner_uv[3 * t],
                          middle = (corners[0] + corners[1] + corners[2]) / 3;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector2f uv = 0.75F * corners[k] + 0.25F * middle;
      std::size_t pixel = 0;
      if (uv.allFinite())
        pixel = place(uv.y(), picture.height) * static_cast<std::size_t>(picture.width) +
                place(uv.x(), picture.width);
      const std::uint8_t* rgb = &picture.rgb[3 * pixel];
      out.U32(rgb[0] | static_cast<std::uint32_t>(rgb[1]) << 8 | static_cast<std::uint32_t>(rgb[2]) << 16);
    }
  }
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
      std::visit(SizeOf{one, meshes, g.picture.get()}, g.shape);
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
  for (const auto& [mesh, picture] : meshes.meshes) {
    out.U32(static_cast<std::uint32_t>(mesh->vertices.size()));
    out.U32(static_cast<std::uint32_t>(mesh->triangles.size()));
    out.U32(picture ? static_cast<std::uint32_t>(mesh->corner_uv.size()) : 0);
    for (const Eigen::Vector3f& v : mesh->vertices)
      for (int i = 0; i < 3; ++i) out.F32(static_cast<double>(v(i)));
    for (const Eigen::Vector3i& t : mesh->triangles)
      for (int i = 0; i < 3; ++i) out.U32(static_cast<std::uint32_t>(t(i)));
    if (picture) CornerColours(*mesh, *picture, out);
  }
  return out.Take();
}

}  // namespace fork1s
