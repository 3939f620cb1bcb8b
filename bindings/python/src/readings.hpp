// What a simulation shows of itself, as arrays.
#pragma once

#include <fork1s/sim/simulation.hpp>

#include "arrays.hpp"

namespace fork1s::python {

/// (b, 7) position and quaternion.
Array Poses(const Simulation& simulation);
/// (b, 6) angular first.
Array Velocities(const Simulation& simulation);
/// (n,) of all mechanisms.
Array JointCoordinates(const Simulation& simulation);
Array JointRates(const Simulation& simulation);
/// Structured array of fork1s.CONTACT.
nb::object Contacts(const Simulation& simulation);

}  // namespace fork1s::python
