// The force of an actuator as a law that is linear in its inputs, its length and its speed.
#pragma once

#include <mujoco/mujoco.h>

#include <fork1s/mechanism/definition.hpp>
#include <optional>
#include <string>
#include <vector>

#include "length.hpp"

namespace fork1s::internal {

/// One number that drives an actuator: adds gain * u to its force.
struct ActuatorInput {
  std::string name;  // of the actuator; with ".pos", ".vel" or ".ff" where it has several
  int ctrl = -1;     // index in mjData::ctrl
  double gain = 0;
  bool setpoint = false;                              // u is where the length is to be
  ControlDynamics dynamics = ControlDynamics::kNone;  // where not, its activation is in the place of u
  double time_constant = 0;                           // s, of a lag, and of a muscle that is activated
  double deactivation_time = 0, smoothing = 0;        // of a muscle: s, and in units of u
};

/// F = Σ gain u + b0 + b1 L + b2 dL/dt, and force a F on each freedom of L.
struct LinearActuator {
  int actuator = -1;
  std::string name;
  Length length;  // gear included
  std::vector<ActuatorInput> inputs;
  double b0 = 0, b1 = 0, b2 = 0;
  std::optional<MuscleDef>
      muscle;  // its force in place of all that, but for name and length; its input has no gain
  std::vector<std::string> left_out;  // parts of the law that are not simulated, each a phrase
};

/// Why an actuator has no such law.
struct ActuatorRefusal {
  std::string kind, why;
};
std::optional<ActuatorRefusal> WhyNoLaw(const mjModel& m, int actuator);
/// Whether `actuatorgroupdisable` switches it off.
bool IsInDisabledGroup(const mjModel& m, int actuator);
/// The dynamics of its activation.
void ReadDynamics(const mjModel& m, int actuator, ActuatorInput& input);

/// Laws of all actuators that have one and move something; `d` as for ActuatorLength.
std::vector<LinearActuator> LinearActuators(const mjModel& m, const mjData& d);

}  // namespace fork1s::internal
