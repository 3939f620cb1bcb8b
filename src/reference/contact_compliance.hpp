// Compliance of contact points and gap biases over a step of h.
//
// A spring k and a damper k τ carry k (δ + τ δ̇) at the depth δ at the end of the step, δ = -(gap + h w_n).
// Solved for the impulse λ_n = h k (δ + τ δ̇) this is λ_n = -w'_n/R_n on the row w' = w + b, and with
// tangents that carry k times their displacement
//     R_n = 1/(h (h + τ) k),   R_t = 1/(h² k),   b_n = gap/(h + τ) if closed.
// An open gap closes within the step at w_n = -gap/h, so b_n = gap/h. (docs/method.md, section 6)
#pragma once

#include <algorithm>
#include <fork1s/reference/full_contact.hpp>

namespace fork1s::reference {

struct ContactCompliance {
  double normal = 0, tangent = 0;  // R_n, R_t [m/s per N·s]
  /// m/s: normal speed R_n λ_n above which the material hardens
  double hardening_speed = 0;
};

inline ContactCompliance ComputeContactCompliance(const FullContactMaterial& material, double h) {
  const double damped_step = h * (1 + material.relaxation_steps);  // h + τ
  return {1 / (h * damped_step * material.stiffness), 1 / (h * h * material.stiffness),
          material.depth / damped_step};
}

/// b_n [m/s] of a contact or of a stop of a joint; `gap` at the start of the step [m or rad].
inline double ComputeGapBias(const FullContactMaterial& material, double gap, double h) {
  if (gap > 0) return gap / h;
  return -std::min(-gap / (h * (1 + material.relaxation_steps)), material.max_push_speed);
}

}  // namespace fork1s::reference
