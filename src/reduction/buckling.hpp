// Linear buckling: by how much a dead load may grow before the tangent stiffness is singular.
#pragma once

#include "reduction/tangent_stiffness.hpp"

namespace fork1s {

struct BucklingMode {
  double factor = 0;  ///< of the dead loads
  VectorX q;          ///< n joint displacements, the largest 1 (rad or m)
};

/// Lowest `count` positive α of (K_0 + α K_σ) x = 0: K_0 is the tangent stiffness at the equilibrium under
/// gravity, controls and preload alone, K_σ its derivative by the share of the dead loads along the path of
/// equilibria there. Errors: kNumerics where that equilibrium is not found or not stable, kUnderdetermined
/// where it has motions of no stiffness.
Expected<std::vector<BucklingMode>> ComputeBucklingModes(const Mechanism& mechanism, const VectorX& q0,
                                                         const std::vector<DeadLoad>& loads,
                                                         const StaticsOptions& options, int count = 3);

}  // namespace fork1s
