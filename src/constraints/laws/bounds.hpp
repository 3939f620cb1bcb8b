// An impulse between two given bounds.
//
//     λ = clamp(y, lower, upper)
// A stop of a joint or tendon has the bounds 0 and infinity; dry friction f has −h f and h f in a step of h.
#pragma once

#include <algorithm>
#include <limits>

#include "law.hpp"

namespace fork1s::internal {

struct BoundLaw {
  using Impulse = double;
  using Jacobian = double;

  double R = 0;
  double lower = 0, upper = std::numeric_limits<double>::infinity();  // N·s or N·m·s

  double Project(double y) const { return std::min(std::max(y, lower), upper); }
  bool IsWithin(double y) const { return y > lower && y < upper; }
  double Derivative(double y) const { return IsWithin(y) ? 1 : 0; }
  /// y of the natural map.
  double Trial(double impulse, double w, double inverse_mass) const {
    return impulse - NaturalMapScale(inverse_mass, R) * (w + R * impulse);
  }
  double Violation(double impulse, double w) const { return impulse - Project(-w / R); }
  double Energy(double y) const {
    const double off = y - Project(y);
    return 0.5 * R * (y * y - off * off);
  }
};
static_assert(ConstraintLaw<BoundLaw>);

}  // namespace fork1s::internal
