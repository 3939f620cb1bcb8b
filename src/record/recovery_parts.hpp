// What tables and frames of RecoveryBuffers have to agree on.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>

namespace fork1s::internal {

/// Whether frames say of its joints what z alone does not tell: how loops are closed exactly.
inline bool IsCorrected(const MechanismDynamics& m) {
  return (m.recovery() == Recovery::kExact || m.recovery() == Recovery::kExpanded) &&
         m.model().loop_rank() > 0;
}

/// Mechanisms and free bodies.
inline int RootsOf(const World& world) {
  return static_cast<int>(world.mechanisms().size() + world.free_bodies().size());
}

}  // namespace fork1s::internal
