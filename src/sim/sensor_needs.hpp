// What sensors need of a step.
#pragma once

#include <fork1s/mechanism/sensor.hpp>

namespace fork1s::internal {

/// Whether a sensor measures a change of velocity over the step.
inline bool NeedsStartMotions(const SensorDef& sensor) {
  switch (sensor.kind) {
    case SensorKind::kAcceleration:
    case SensorKind::kAngularAcceleration:
    case SensorKind::kForce:
    case SensorKind::kTorque:
      return true;
    default:
      return false;
  }
}

}  // namespace fork1s::internal
