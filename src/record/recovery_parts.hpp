// What tables and frames of RecoveryBuffers have to agree on.
#pragma once

#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/sim/simulation.hpp>

namespace fork1s::internal {

/// Whether frames say of its joints what z alone does not tell.
inline bool IsCorrected(const MechanismDynamics& m) {
  if (m.recovery() == Recovery::kTwist) return false;
  const ReducedModel& model = m.model();
  return model.has_complement || (model.loop_rank() > 0 && !model.curvature.exists());
}

/// Mechanisms and free bodies.
inline int RootsOf(const World& world) {
  return static_cast<int>(world.mechanisms().size() + world.free_bodies().size());
}

}  // namespace fork1s::internal
