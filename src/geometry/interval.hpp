// Where a ray goes through a shape.
#pragma once

#include <algorithm>
#include <cmath>
#include <fork1s/base/types.hpp>
#include <limits>

namespace fork1s {

/// Where a ray p + t d, t >= 0, is inside of something: t from `first` to `last`.
struct RayInterval {
  double first = 0, last = std::numeric_limits<double>::infinity();
  bool is_empty() const { return !(first <= last); }
};
inline constexpr RayInterval kEmptyRayInterval{1, 0};

inline RayInterval Both(const RayInterval& a, const RayInterval& b) {
  return {std::max(a.first, b.first), std::min(a.last, b.last)};
}

/// Between the planes x = ±half.
inline RayInterval InSlab(double p, double d, double half) {
  if (d == 0) return std::abs(p) <= half ? RayInterval{} : kEmptyRayInterval;
  const double a = (-half - p) / d, b = (half - p) / d;
  return {std::max(0.0, std::min(a, b)), std::max(a, b)};
}

/// In a box of these half sizes about the origin, along the axes.
inline RayInterval InBox(const Vector3& p, const Vector3& d, const Vector3& half) {
  RayInterval inside;
  for (int i = 0; i < 3; ++i) inside = Both(inside, InSlab(p(i), d(i), half(i)));
  return inside;
}

}  // namespace fork1s
