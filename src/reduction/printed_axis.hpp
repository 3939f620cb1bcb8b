// How an axis is printed.
#pragma once

#include <cmath>
#include <fork1s/base/types.hpp>

namespace fork1s::internal {

/// The unit vector along v whose largest entry is positive, as a motion has no sign, and whose rounding is 0.
inline Vector3 PrintedAxis(const Vector3& v) {
  Vector3 axis = v.normalized();
  int largest = 0;
  for (int i = 1; i < 3; ++i)
    if (std::abs(axis(i)) > std::abs(axis(largest))) largest = i;
  if (axis(largest) < 0) axis = -axis;
  for (int i = 0; i < 3; ++i)
    if (std::abs(axis(i)) < 5e-4) axis(i) = 0;
  return axis;
}

}  // namespace fork1s::internal
