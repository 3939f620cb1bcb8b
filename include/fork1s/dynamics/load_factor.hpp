// How much harder a grasp may press before it ejects what it holds.
#pragma once

#include <fork1s/dynamics/world.hpp>
#include <limits>
#include <string>

namespace fork1s {

struct LoadFactor {
  /// Smallest positive multiple of the present contact forces at which the grasp loses stability; infinite
  /// if none.
  double factor = std::numeric_limits<double>::infinity();
  std::string body;  // free body that moves most in the unstable direction
  int contacts = 0;  // that carry force and took part; 0 if fewer than two hold any free body
};

/// docs/method.md, section 6: eigenvalues of the contacts' geometric stiffness against that of the springs,
/// on motions in which every loaded contact rolls without sliding. h [s]: the length of the world's last
/// step. Allocates: not meant for every step.
LoadFactor ComputeLoadFactor(const World& world, double h);

}  // namespace fork1s
