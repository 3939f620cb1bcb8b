// How much harder a grasp may press before it ejects what it holds.
#pragma once

#include <fork1s/world/world.hpp>
#include <limits>
#include <string>
#include <vector>

namespace fork1s {

struct LoadFactor {
  /// Smallest positive multiple of the present contact forces at which the grasp loses stability; infinite
  /// if none.
  double factor = std::numeric_limits<double>::infinity();
  std::string body;  // free body that moves most in the unstable direction
  int contacts = 0;  // that carry force and took part; 0 if fewer than two hold any free body
};

/// A contact that bears force.
struct LoadedContact {
  /// What it is on: a body of a mechanism of the world, a free body, or, with neither, what stands still.
  struct Side {
    int mechanism = -1;
    BodyIndex body{};  // of the mechanism
    int free_body = -1;
  };
  Side a, b;
  Vector3 point;                   // m, world axes, as are the others
  Vector3 force;                   // N, on b
  Vector3 normal;                  // from a to b
  Matrix3 inverse_curvature;       // m, (κ_a + κ_b)⁻¹ on the tangent plane: ComputeInverseCurvature
  Vector3 pull = Vector3::Zero();  // N, on b, of adhesion: `force` bears the compression by it
};

/// The contacts of the world's last step, of length h [s].
std::vector<LoadedContact> LoadedContacts(const World& world, double h);

/// docs/method.md, section 6: eigenvalues of the contacts' geometric stiffness against that of the springs,
/// on motions in which every loaded contact rolls without sliding. Of the world only mechanisms and free
/// bodies count, at their present poses. Allocates: not meant for every step.
LoadFactor ComputeLoadFactor(const World& world, const std::vector<LoadedContact>& contacts);

/// That of the contacts of its last step, of length h [s].
LoadFactor ComputeLoadFactor(const World& world, double h);

}  // namespace fork1s
