// The trunk of a walker: what stands for it in figures of a whole run.
#pragma once

#include <fork1s/sim/simulation.hpp>

namespace fork1s::internal {

/// Whether a body of Simulation::bodies() is the base of a mechanism that moves freely.
inline bool IsFloatingBase(const Simulation& simulation, const SceneBody& body) {
  if (body.given < 0) return false;
  const Mechanism& mechanism = simulation.given_mechanism(body.given);
  return mechanism.base() == BaseKind::kFloating && mechanism.body(BodyIndex(0)).name == body.name;
}

}  // namespace fork1s::internal
