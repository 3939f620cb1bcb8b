// A system at one pose and velocity: what a stage, projections and energies evaluate.
#pragma once

#include <fork1s/constraints/contact_solver.hpp>
#include <vector>

#include "multibody.hpp"

namespace fork1s::lab {

/// Everything of one pose and velocity that a Newton iteration needs.
struct Linearization {
  VectorX p, f, c;    // p(V, x), f(x, V), constraints
  VectorX f_abs;      // sum of the magnitudes of f's terms, the scale of its rounding
  MatrixX A_p, K, D;  // dp/dV for x = x̂ ⊕ b V, −∂f/∂x, −∂f/∂V
  MatrixX G, J;       // −∂(Jᵀλ)/∂x, ∂c/∂x
  MatrixX M;          // inertia in world axes
};

/// `derivatives`: A_p, K, D, G and M as well. `geometric`: K has the stiffness that is proportional to forces.
Linearization Linearize(const System& s, const std::vector<Pose>& poses, const VectorX& V,
                        const VectorX& lambda, double b, bool derivatives, bool geometric = true);

std::vector<Pose> ComposeAll(const std::vector<Pose>& poses, const VectorX& displacement);
VectorX DifferenceAll(const std::vector<Pose>& to, const std::vector<Pose>& from);

struct ContactGeometry {
  double gap;
  Matrix3 frame;      // rows: normal, tangents
  Matrix36 J_a, J_b;  // of the relative velocity in that frame
};

ContactGeometry ComputeContact(const ContactPair& c, const std::vector<Pose>& poses);

}  // namespace fork1s::lab
