// Stiffnesses that follow an ellipsoid of compliance that a viewer drags.
#pragma once

#include "server/live_settings.hpp"

namespace fork1s::internal {

/// How a body of a mechanism is to give way to forces at its origin, at joint displacements q.
struct ComplianceWish {
  int mechanism = 0;
  BodyIndex body;
  VectorX q;                      // of the mechanism, closing its loops
  Matrix3 C_R = Matrix3::Zero();  // m/N, axes of the root
  double factor = 1;              // above 1: bound on every stiffness over the file's, and its inverse
};

/// Compliances of the body [m/N] in the axes of the root. That along any direction falls with every
/// stiffness, so with all of them at a bound it is the least and the greatest there can be.
struct FollowedWish {
  Matrix3 reached_R, stiffest_R, softest_R;
  int num_stiffnesses = 0, num_at_bound = 0;
};

/// Changes stiffnesses of joints and servos among `settings.tunables` until the body gives way as wished, or
/// as nearly as they can within `wish.factor` of the file's; a stiffness that a viewer has put beyond may
/// stay there. Projected least squares on logarithms with exact gradients, ∂C/∂k = -y yᵀ (docs/method.md,
/// section 3), each step the shortest that leads there. `scene`: as the file has it. Errors: kUsage where no
/// such stiffness moves the body, and beyond 200 joint coordinates; as of BuildMechanism.
Expected<FollowedWish> FollowWish(const Scene& scene, const ComplianceWish& wish, LiveSettings& settings);

}  // namespace fork1s::internal
