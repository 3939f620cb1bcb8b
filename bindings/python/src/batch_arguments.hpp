// What makes the members of a batch differ, from arguments of Python.
#pragma once

#include "batch.hpp"

namespace fork1s::python {

/// Throws Refused, and TypeError or ValueError that name the argument.
Randomisation ReadRanges(const nb::object& given);
/// seeds: one for all, from which each member's is mixed, or one for each. stiffness, friction, mass: a
/// number for all, or one for each. factors: by the key of SetFactor, likewise. Throws as above.
MemberDifferences ReadDifferences(std::size_t count, const nb::object& seeds, const nb::object& stiffness,
                                  const nb::object& friction, const nb::object& mass,
                                  const nb::object& factors);

}  // namespace fork1s::python
