// Contact material: a spring and a damper at each point, in SI units.
//
// A point carries the force k (δ + τ δ̇) for a depth δ at the end of the step, never less than 0, k growing with δ beyond
// `depth` (ContactConstraint::kHardeningExponent), and k s
// along its tangents, s what the two surfaces have moved against each other since it touched, up to the cone.
// In the rows of a step,
//     R_n = 1/(h (h + τ) k),   b_n = gap/h while open, gap/(h + τ) once closed,   R_t = 1/(h² k)
#pragma once

#include <algorithm>
#include <cmath>
#include <fork1s/constraints/contact_solver.hpp>

namespace fork1s {

struct ContactMaterial {
  double stiffness = 1e6;       // N/m: 2 E a of a pad of 100 MPa whose patch has a radius a of 5 mm
  double depth = 1e-5;          // m: up to it the load is linear (ContactConstraint::kHardeningExponent)
  double relaxation_steps = 4;  // τ/h: time constant in which penetration beyond `depth` decays
  double max_push_speed =
      0.1;  // m/s: largest speed at which overlaps are separated; bodies hop by 0.5 mm then
};

inline void SetMaterial(const ContactMaterial& material, double gap, double h, ContactConstraint& c) {
  const double k = material.stiffness, tau = material.relaxation_steps * h;
  c.hardening_speed = material.depth / (h + tau);
  c.compliance_normal = 1 / (h * (h + tau) * k);
  c.compliance_tangent = 1 / (h * h * k);
  c.bias[0] = gap > 0 ? gap / h : std::max(gap / (h + tau), -material.max_push_speed);
}

/// Normal speed [m/s] at which a contact parts at the end of a step within which it is met, 0 where it stays.
/// `approach`: speed of approach before the step; `free_speed`: normal speed after it if nothing were met.
/// What is left of the energy at touch, e² of it, is that of the end of the step: with the acceleration a of
/// the free motion and the place gap + h u,
///     u²/2 + a (gap + h u) = e² u_c²/2,   u_c² = approach² + 2 a gap
/// A bounce that would end below the gap has no such u: the contact closes in this step and parts in the
/// next. What approaches no faster than the free motion makes it within one step stays.
inline double ReboundSpeed(double restitution, double approach, double free_speed, double gap, double h) {
  if (!(restitution > 0 && approach > 0) || gap + h * free_speed >= 0) return 0;
  const double gained = -free_speed - approach;  // a h
  if (approach <= gained) return 0;
  const double fall = 2 * gained / h * gap;
  const double left = restitution * restitution * std::max(0.0, approach * approach + fall) - fall;
  return left > 0 ? std::sqrt(gained * gained + left) - gained : 0;
}

/// A stop of a joint: the same gap, without a spring of its own.
inline double StopBias(const ContactMaterial& material, double gap, double h) {
  return gap > 0 ? gap / h : std::max(gap / (h + material.relaxation_steps * h), -material.max_push_speed);
}

}  // namespace fork1s
