// Meshes of tests.
#pragma once

#include <cmath>
#include <fork1s/geometry/shape.hpp>
#include <memory>
#include <numbers>

namespace fork1s::testing {

/// The corners of a box as a mesh, moved away from its own centre by `shift`.
inline MeshShape BoxMesh(const Vector3& half, const Vector3& shift) {
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->name = "box";
  for (int k = 0; k < 8; ++k) {
    const Vector3 corner(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1);
    mesh->vertices.push_back((corner.cwiseProduct(half) + shift).cast<float>());
  }
  constexpr int kQuads[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& q : kQuads) {
    mesh->triangles.emplace_back(q[0], q[1], q[2]);
    mesh->triangles.emplace_back(q[0], q[2], q[3]);
  }
  return MeshShape{mesh};
}

/// The corners of a prism about z, of so many sides, as a mesh.
inline MeshShape PrismMesh(int sides, double radius, double half_height) {
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->name = "prism";
  for (int k = 0; k < 2 * sides; ++k) {
    const double angle = 2 * std::numbers::pi * (k / 2) / sides;
    mesh->vertices.push_back(
        Vector3(radius * std::cos(angle), radius * std::sin(angle), k % 2 ? half_height : -half_height)
            .cast<float>());
  }
  return {mesh};
}

}  // namespace fork1s::testing
