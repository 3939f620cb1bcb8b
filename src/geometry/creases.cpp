// Files give no normals here. A corner's normal is the mean, weighted by area, of the triangles around its
// vertex that face nearly the same way as its own triangle; a vertex is written once for every such mean.
#include "creases.hpp"

#include <array>
#include <cmath>
#include <fork1s/base/error.hpp>
#include <map>

namespace fork1s::internal {
namespace {

struct Face {
  std::size_t number;      // of the triangle
  Eigen::Vector3i points;  // numbers of welded vertices
  Vector3 unit_normal;
  Vector3 area_normal;
};

// The same number for vertices at the same place: files often write a vertex once per triangle.
std::vector<int> Weld(const std::vector<Eigen::Vector3f>& vertices) {
  std::map<std::array<float, 3>, int> known;
  std::vector<int> numbers;
  for (const Eigen::Vector3f& v : vertices) {
    FORK1S_REQUIRE(v.allFinite(), v.transpose());
    numbers.push_back(
        known.emplace(std::array{v.x(), v.y(), v.z()}, static_cast<int>(known.size())).first->second);
  }
  return numbers;
}

std::vector<Face> Faces(const TriangleMesh& mesh, const std::vector<int>& welded) {
  std::vector<Face> faces;
  for (std::size_t number = 0; number < mesh.triangles.size(); ++number) {
    const Eigen::Vector3i& t = mesh.triangles[number];
    FORK1S_REQUIRE(t.minCoeff() >= 0 && t.maxCoeff() < static_cast<int>(mesh.vertices.size()), mesh.name,
                   t.transpose(), mesh.vertices.size());
    auto at = [&](int k) -> Vector3 { return mesh.vertices[static_cast<std::size_t>(t(k))].cast<double>(); };
    const Vector3 normal = (at(1) - at(0)).cross(at(2) - at(0));
    const double twice_area = normal.norm();
    if (!(twice_area > 0)) continue;
    auto place = [&](int k) { return welded[static_cast<std::size_t>(t(k))]; };
    faces.push_back({number, {place(0), place(1), place(2)}, normal / twice_area, normal});
  }
  return faces;
}

}  // namespace

Surface WithNormals(const TriangleMesh& mesh, double crease) {
  const bool has_uv = !mesh.corner_uv.empty();
  FORK1S_REQUIRE(!has_uv || mesh.corner_uv.size() == 3 * mesh.triangles.size(), mesh.name,
                 mesh.corner_uv.size(), mesh.triangles.size());
  const std::vector<int> welded = Weld(mesh.vertices);
  const std::vector<Face> faces = Faces(mesh, welded);
  std::vector<Eigen::Vector3f> place(mesh.vertices.size());
  for (std::size_t i = 0; i < welded.size(); ++i)
    place[static_cast<std::size_t>(welded[i])] = mesh.vertices[i];
  std::vector<std::vector<const Face*>> around(mesh.vertices.size());
  for (const Face& face : faces)
    for (int point : face.points) around[static_cast<std::size_t>(point)].push_back(&face);

  Surface out;
  std::vector<std::vector<int>> written(mesh.vertices.size());  // vertices of `out` at each place
  const double least = std::cos(crease);
  for (const Face& face : faces) {
    Eigen::Vector3i triangle;
    for (int k = 0; k < 3; ++k) {
      const auto point = static_cast<std::size_t>(face.points(k));
      Vector3 sum = Vector3::Zero();
      for (const Face* other : around[point])
        if (other == &face || other->unit_normal.dot(face.unit_normal) >= least) sum += other->area_normal;
      const Eigen::Vector3f normal = sum.normalized().cast<float>();
      const Eigen::Vector2f uv =
          has_uv ? mesh.corner_uv[3 * face.number + static_cast<std::size_t>(k)] : Eigen::Vector2f::Zero();
      int vertex = -1;
      for (int known : written[point])
        if (out.normals[static_cast<std::size_t>(known)] == normal &&
            (!has_uv || out.uv[static_cast<std::size_t>(known)] == uv))
          vertex = known;
      if (vertex < 0) {
        vertex = static_cast<int>(out.vertices.size());
        out.vertices.push_back(place[point]);
        out.normals.push_back(normal);
        if (has_uv) out.uv.push_back(uv);
        written[point].push_back(vertex);
      }
      triangle(k) = vertex;
    }
    out.triangles.push_back(triangle);
  }
  return out;
}

}  // namespace fork1s::internal
