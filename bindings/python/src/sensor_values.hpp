// What the sensors of a simulation, or of all members of a batch, measured at one moment.
#pragma once

#include <nanobind/nanobind.h>

#include <optional>
#include <string>
#include <vector>

namespace fork1s::python {

struct SensorValues {
  std::vector<std::string> names;
  std::vector<std::string> reasons;    // why a sensor has no value; empty: it has one
  std::vector<std::size_t> first;      // value of each, and the number of all
  std::optional<std::size_t> members;  // of a batch
  std::vector<double> values;          // member after member
};

/// The same of the actuators of a simulation, one value each.
struct ActuatorForces : SensorValues {};

}  // namespace fork1s::python
