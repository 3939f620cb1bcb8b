// What a simulation shows of itself, as plain numbers: no function but ToArray needs the GIL.
#pragma once

#include <fork1s/sim/simulation.hpp>

#include "arrays.hpp"

namespace fork1s::python {

/// One row of the structured array fork1s.CONTACT; fork1s/_contacts.py describes the same bytes to numpy.
struct ContactRow {
  std::int32_t bodies[2];
  double point[3], normal[3], force[3], torque[3];  // world axes; m, N, N·m
  double gap, friction;                             // m
  double friction_use;
  double pull[3];
};

/// (b, 7) position and quaternion.
Table Poses(const Simulation& simulation);
/// (b, 6) angular first.
Table Velocities(const Simulation& simulation);
/// (n,) of all mechanisms.
std::vector<double> JointCoordinates(const Simulation& simulation);
std::vector<double> JointRates(const Simulation& simulation);
std::vector<ContactRow> Contacts(const Simulation& simulation);

/// Structured array of fork1s.CONTACT.
nb::object ToArray(std::vector<ContactRow> rows);

}  // namespace fork1s::python
