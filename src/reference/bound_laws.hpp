// Scalar laws: an impulse or moment between two bounds.
//
// Bounds that are given: λ = clamp(y, lower, upper), y = λ₀ - w/R. A unilateral stop has the bounds 0 and
// infinity; the dry friction f of a joint has -h f and h f over a step of h.
//
// Bounds that follow a normal impulse: torsional and rolling friction, m = clamp(y, -r λ_n, r λ_n) with the
// radius r [m] of the patch (M. Ciocarlie, C. Lackner and P. Allen, World Haptics 2007, with one bound an
// axis instead of an ellipsoid).
#pragma once

#include <algorithm>
#include <fork1s/base/types.hpp>

namespace fork1s::reference {

struct BoundProjection {
  double impulse = 0;     // Π(y)
  double derivative = 0;  // ∂Π/∂y
};

inline BoundProjection ProjectOntoBounds(double y, double lower, double upper) {
  if (y < lower) return {lower, 0};
  if (y > upper) return {upper, 0};
  return {y, 1};
}

/// The impulse at the velocity w; `derivative` is ∂λ/∂w.
inline BoundProjection EvaluateBoundLaw(double w, double compliance, double previous_impulse, double lower,
                                        double upper) {
  BoundProjection out = ProjectOntoBounds(previous_impulse - w / compliance, lower, upper);
  out.derivative /= -compliance;
  return out;
}

struct MomentProjection {
  double moment = 0;     // Π(y, λ_n)
  double by_y = 0;       // ∂Π/∂y
  double by_normal = 0;  // ∂Π/∂λ_n
};

inline MomentProjection ProjectMoment(double y, double radius, double normal_impulse) {
  const double bound = radius * std::max(0.0, normal_impulse);
  if (y > bound) return {bound, 0, normal_impulse > 0 ? radius : 0};
  if (y < -bound) return {-bound, 0, normal_impulse > 0 ? -radius : 0};
  return {y, 1, 0};
}

}  // namespace fork1s::reference
