// Meshes that cannot mean what they say: in another unit, or hollow where contact takes the convex hull.
//
// Volumes are by the divergence theorem, V = 1/6 Σ a · (b × c) over the triangles, which is that of the solid
// where the triangles close a surface and face outwards.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "conversion.hpp"
#include "urdf.hpp"

namespace fork1s::internal {
namespace {

using Triangle = std::array<int, 3>;

std::vector<Triangle> Triangles(const int* corners, int count) {
  std::vector<Triangle> triangles;
  for (int i = 0; i < count; ++i)
    triangles.push_back({corners[3 * i], corners[3 * i + 1], corners[3 * i + 2]});
  return triangles;
}

std::vector<Triangle> TrianglesOf(const mjModel& m, int mesh) {
  return Triangles(m.mesh_face + 3 * m.mesh_faceadr[mesh], m.mesh_facenum[mesh]);
}

// MuJoCo's graph: counts of vertices and faces, two numbers a vertex, the edges, then the corners of the
// faces.
std::vector<Triangle> HullOf(const mjModel& m, int mesh) {
  if (m.mesh_graphadr[mesh] < 0) return {};
  const int* graph = m.mesh_graph + m.mesh_graphadr[mesh];
  const int vertices = graph[0], faces = graph[1];
  return Triangles(graph + 2 + 3 * vertices + 3 * faces, faces);
}

Vector3 Vertex(const mjModel& m, int mesh, int i) {
  const float* v = m.mesh_vert + 3 * (m.mesh_vertadr[mesh] + i);
  return Eigen::Vector3f(v[0], v[1], v[2]).cast<double>();
}

double Volume(const mjModel& m, int mesh, const std::vector<Triangle>& triangles) {
  double volume = 0;
  for (const auto& [a, b, c] : triangles)
    volume += Vertex(m, mesh, a).dot(Vertex(m, mesh, b).cross(Vertex(m, mesh, c))) / 6;
  return std::abs(volume);
}

// Whether every edge has one triangle on either side, in opposite directions. Vertices at one place are one.
bool IsClosed(const mjModel& m, int mesh, const std::vector<Triangle>& triangles) {
  std::map<std::array<float, 3>, int> places;
  const auto place = [&](int i) {
    const float* v = m.mesh_vert + 3 * (m.mesh_vertadr[mesh] + i);
    return places.try_emplace({v[0], v[1], v[2]}, static_cast<int>(places.size())).first->second;
  };
  std::set<std::pair<int, int>> edges;
  for (const Triangle& t : triangles)
    for (std::size_t k = 0; k < 3; ++k)
      if (!edges.emplace(place(t[k]), place(t[(k + 1) % 3])).second) return false;
  return std::all_of(edges.begin(), edges.end(), [&](const auto& edge) {
    return edges.count({edge.second, edge.first}) > 0;
  });
}

// The longest side of the box around the mesh in the axes of its file: MuJoCo turns it to its principal axes.
double Span(const mjModel& m, int mesh) {
  const Quaternion to_file = Quat(m.mesh_quat + 4 * mesh);
  Eigen::AlignedBox3d bounds;
  for (int i = 0; i < m.mesh_vertnum[mesh]; ++i) bounds.extend(to_file * Vertex(m, mesh, i));
  return bounds.sizes().maxCoeff();
}

}  // namespace

void ListDoubtfulMeshes(Conversion& c) {
  constexpr double kAir = 1.2;  // kg/m³ at sea level; no part of a machine is lighter
  const mjModel& m = c.m;
  std::set<int> large, hollow;  // meshes that have their note
  std::vector<std::string> hollow_names;
  for (int g = 0; g < m.ngeom; ++g) {
    const int mesh = m.geom_dataid[g], body = m.geom_bodyid[g];
    if (m.geom_type[g] != mjGEOM_MESH || mesh < 0) continue;
    const std::string name = NameOr(m, m.name_meshadr[mesh], "mesh", mesh);
    const std::vector<Triangle> triangles = TrianglesOf(m, mesh);
    const double volume = Volume(m, mesh, triangles), mass = m.body_mass[body];
    if (m.body_weldid[body] != 0 && !IsMasslessUrdf(mass) && mass < kAir * volume &&
        large.insert(mesh).second)
      c.Note(
          ImportNote::Kind::kChosen, fmt::format("mesh '{}'", name),
          fmt::format("its numbers are taken as metres, so it spans {:.4g} m, and body '{}' of {:.4g} kg is "
                      "lighter than air; if they are millimetres, give it the scale 0.001 0.001 0.001",
                      Span(m, mesh), c.body_names[body], mass));
    const bool touches = m.geom_contype[g] != 0 || m.geom_conaffinity[g] != 0;
    if (touches && hollow.count(mesh) == 0 && volume < 0.5 * Volume(m, mesh, HullOf(m, mesh)) &&
        IsClosed(m, mesh, triangles)) {
      hollow.insert(mesh);
      hollow_names.push_back(name);
    }
  }
  c.DroppedMany(
      "hollow of mesh", hollow_names,
      "contact takes the convex hull, of which the mesh fills less than half; an MJCF in which it is "
      "convex pieces is written by: python -m fork1s.decompose MODEL.xml OUT.xml (a URDF is first "
      "converted: fork1s export MODEL.urdf MODEL.xml)");
}

}  // namespace fork1s::internal
