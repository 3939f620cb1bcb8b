#include "geometry/surface.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/base/error.hpp>
#include <numbers>

#include "creases.hpp"

namespace fork1s {
namespace {

constexpr double kPi = std::numbers::pi;

int AddVertex(Surface& out, const Vector3& p, const Vector3& n) {
  out.vertices.push_back(p.cast<float>());
  out.normals.push_back(n.cast<float>());
  return static_cast<int>(out.vertices.size()) - 1;
}

// A circle about z, with the outward normal along it.
struct Ring {
  double radius, z, normal_r, normal_z;
};

// The surface that a profile sweeps about z, from below to above. A ring of radius 0 is one vertex.
void Revolve(const std::vector<Ring>& profile, int sides, Surface& out) {
  std::vector<int> first;
  for (const Ring& ring : profile) {
    first.push_back(static_cast<int>(out.vertices.size()));
    for (int k = 0; k < (ring.radius > 0 ? sides : 1); ++k) {
      const double angle = 2 * kPi * k / sides, c = std::cos(angle), s = std::sin(angle);
      AddVertex(out, {ring.radius * c, ring.radius * s, ring.z},
                {ring.normal_r * c, ring.normal_r * s, ring.normal_z});
    }
  }
  for (std::size_t i = 0; i + 1 < profile.size(); ++i) {
    const bool below = profile[i].radius > 0, above = profile[i + 1].radius > 0;
    for (int k = 0; k < sides; ++k) {
      const int next = (k + 1) % sides;
      const int a = first[i] + (below ? k : 0), a_next = first[i] + (below ? next : 0);
      const int b = first[i + 1] + (above ? k : 0), b_next = first[i + 1] + (above ? next : 0);
      if (below) out.triangles.emplace_back(a, a_next, b);
      if (above) out.triangles.emplace_back(a_next, b_next, b);
    }
  }
}

// Half circles from pole to pole, drawn apart at the equator by 2 half_length: a sphere or a capsule.
std::vector<Ring> CapsuleProfile(double radius, double half_length, int sides) {
  const int quarter = sides / 4;
  std::vector<Ring> profile;
  for (int j = -quarter; j <= quarter; ++j) {
    const double latitude = kPi / 2 * j / quarter, s = std::sin(latitude);
    const double c = std::abs(j) == quarter ? 0 : std::cos(latitude);
    if (j <= 0) profile.push_back({radius * c, radius * s - half_length, c, s});
    if (j > 0 || (j == 0 && half_length > 0)) profile.push_back({radius * c, radius * s + half_length, c, s});
  }
  return profile;
}

// A rectangle with its corners counter-clockwise as seen from the tip of x cross y.
void AddRectangle(const Vector3& middle, const Vector3& x, const Vector3& y, const Vector3& normal,
                  Surface& out) {
  const int a = AddVertex(out, middle - x - y, normal);
  AddVertex(out, middle + x - y, normal);
  AddVertex(out, middle + x + y, normal);
  AddVertex(out, middle - x + y, normal);
  out.triangles.emplace_back(a, a + 1, a + 2);
  out.triangles.emplace_back(a, a + 2, a + 3);
}

struct SurfaceOf {
  const SurfaceOptions& options;
  Surface out = {};

  void operator()(const Plane& s) {
    const double x = s.half_x > 0 ? s.half_x : options.plane_half;
    const double y = s.half_y > 0 ? s.half_y : options.plane_half;
    AddRectangle(Vector3::Zero(), x * Vector3::UnitX(), y * Vector3::UnitY(), Vector3::UnitZ(), out);
  }
  void operator()(const Sphere& s) {
    Revolve(CapsuleProfile(s.radius, 0, options.sides), options.sides, out);
  }
  void operator()(const Capsule& s) {
    Revolve(CapsuleProfile(s.radius, s.half_length, options.sides), options.sides, out);
  }
  void operator()(const Cylinder& s) {
    const double r = s.radius, h = s.half_length;
    Revolve({{0, -h, 0, -1}, {r, -h, 0, -1}}, options.sides, out);
    Revolve({{r, -h, 1, 0}, {r, h, 1, 0}}, options.sides, out);
    Revolve({{r, h, 0, 1}, {0, h, 0, 1}}, options.sides, out);
  }
  void operator()(const Ellipsoid& s) {
    Revolve(CapsuleProfile(1, 0, options.sides), options.sides, out);
    for (std::size_t i = 0; i < out.vertices.size(); ++i) {
      const Vector3 on_sphere = out.vertices[i].cast<double>();
      out.vertices[i] = s.radii.cwiseProduct(on_sphere).cast<float>();
      out.normals[i] = on_sphere.cwiseQuotient(s.radii).normalized().cast<float>();
    }
  }
  void operator()(const Box& s) {
    for (int axis = 0; axis < 3; ++axis)
      for (double sign : {-1.0, 1.0}) {
        const Vector3 normal = sign * Vector3::Unit(axis);
        const Vector3 x = Vector3::Unit((axis + 1) % 3), y = sign * Vector3::Unit((axis + 2) % 3);
        AddRectangle(s.half.cwiseProduct(normal), s.half.cwiseProduct(x), s.half.cwiseProduct(y), normal,
                     out);
      }
  }
  void operator()(const MeshShape& s) {
    if (s.mesh) out = internal::WithNormals(*s.mesh, options.crease);
  }
  void operator()(const HeightField& s) {
    if (s.grid) out = internal::WithNormals(GridTriangles(*s.grid), options.crease);
  }
};

}  // namespace

Surface MakeSurface(const Shape& shape, const SurfaceOptions& options) {
  FORK1S_REQUIRE(options.sides >= 4 && options.sides % 4 == 0, options.sides);
  SurfaceOf make{options};
  std::visit(make, shape);
  return std::move(make.out);
}

TriangleMesh GridTriangles(const HeightGrid& grid) {
  FORK1S_REQUIRE(
      grid.rows >= 0 && grid.columns >= 0 &&
          grid.values.size() == static_cast<std::size_t>(grid.rows) * static_cast<std::size_t>(grid.columns),
      grid.name, grid.rows, grid.columns, grid.values.size());
  TriangleMesh mesh;
  mesh.name = grid.name;
  for (int i = 0; i < grid.rows; ++i)
    for (int j = 0; j < grid.columns; ++j) {
      const double x = -grid.half_x + 2 * grid.half_x * j / std::max(1, grid.columns - 1);
      const double y = -grid.half_y + 2 * grid.half_y * i / std::max(1, grid.rows - 1);
      const double z =
          grid.max_height *
          static_cast<double>(
              grid.values[static_cast<std::size_t>(static_cast<std::int64_t>(i) * grid.columns + j)]);
      mesh.vertices.emplace_back(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
    }
  for (int i = 0; i + 1 < grid.rows; ++i)
    for (int j = 0; j + 1 < grid.columns; ++j) {
      const int a = i * grid.columns + j, b = a + grid.columns;
      mesh.triangles.emplace_back(a, a + 1, b + 1);  // the diagonal that collision has
      mesh.triangles.emplace_back(a, b + 1, b);
    }
  return mesh;
}

}  // namespace fork1s
