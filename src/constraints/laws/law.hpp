// What every law of a bounded impulse offers the solver.
//
// A law relates an impulse λ [N·s or N·m·s] to the velocity w [m/s or rad/s] along its rows by a projection Π on
// the admissible impulses in the metric of its compliance R [m/s per N·s]:
//     λ = Π(−w/R),   equivalently   λ = Π(y),   y = λ − ρ (w + R λ)   for any ρ > 0
// (the natural map; P. Alart and A. Curnier, CMAME 92, 1991). w contains everything that shifts the relative
// velocity: R λ₀ of the impulse λ₀ of the last step, gaps, speeds of surfaces.
#pragma once

#include <concepts>

namespace fork1s::internal {

/// ρ of the natural map: R and the inverse mass that the row sees weigh forces and velocities alike.
inline double NaturalMapScale(double inverse_mass, double R) { return 1 / (inverse_mass + R); }

/// Project(y): the admissible impulse. Derivative(y): ∂Π/∂y. Violation(λ, w): λ − Π(−w/R), zero at solutions and
/// in the unit of λ. Energy(y) [J]: the convex function with the gradient R Π(y).
template <class Law>
concept ConstraintLaw = requires(const Law& law, const typename Law::Impulse& y) {
  { law.Project(y) } -> std::convertible_to<typename Law::Impulse>;
  { law.Derivative(y) } -> std::convertible_to<typename Law::Jacobian>;
  { law.Violation(y, y) } -> std::convertible_to<typename Law::Impulse>;
  { law.Energy(y) } -> std::same_as<double>;
};

}  // namespace fork1s::internal
