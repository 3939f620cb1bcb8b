// Stiffnesses that follow an ellipsoid of compliance that a viewer drags.
#pragma once

#include <fork1s/server/live_settings.hpp>

namespace fork1s::internal {

/// How a body of a mechanism is to give way to forces at its origin, at joint displacements q.
struct ComplianceWish {
  int mechanism = 0;
  BodyIndex body;
  VectorX q;                      // of the mechanism, closing its loops
  Matrix3 C_R = Matrix3::Zero();  // m/N, axes of the root
};

/// Changes stiffnesses of joints and servos among `settings.tunables` until the body gives way as wished, or
/// as nearly as they can: to a thousandth and to a thousand times those of the file. Least squares on
/// logarithms with exact gradients, ∂C/∂k = -y yᵀ (docs/method.md, section 4), each step the shortest that
/// leads there. `scene`: as the file has it. Returns what is missed, the largest entry over the largest
/// wished. Errors: kUsage where no such stiffness moves the body, and beyond 200 joint coordinates; as of BuildMechanism.
Expected<double> FollowWish(const Scene& scene, const ComplianceWish& wish, LiveSettings& settings);

}  // namespace fork1s::internal
