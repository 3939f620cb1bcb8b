// Freedoms of joints: their names, and lengths along one of them alone.
#pragma once

#include <fork1s/mechanism/definition.hpp>
#include <string>

namespace fork1s::internal {

/// Of freedom number `freedom` of a joint with `count` of them, as Mechanism::CoordinateName.
inline std::string CoordinateName(const std::string& joint, int count, int freedom) {
  return count == 1 ? joint : joint + " (freedom " + std::to_string(freedom + 1) + ")";
}

/// Whether a length (of a spring, servo, control) is that of this freedom, times a coefficient.
template <class Length>
bool IsAlong(FreedomRef freedom, const Length& length) {
  return length.along.path < 0 && length.terms.size() == 1 && length.terms[0].first.joint == freedom.joint &&
         length.terms[0].first.freedom == freedom.freedom;
}

inline bool HasStiffness(const SpringDef& s) {
  return s.stiffness > 0 || s.higher_stiffness != std::array<double, 2>{};
}

}  // namespace fork1s::internal
