// The contact problem of a step in contact space.
//
// Rows: per point the normal, two tangents and the moments that it carries; then one row per bound
// constraint. With the rows J of the points in the stacked velocities, W = J W_v Jᵀ and b = J v* + bias,
//     g(x) = A x + c,   A = W + R,   c = b - R x₀,   x = Π(x - ρ g(x))
// for the impulses x and those of the step before x₀ (0 for normals and stops), diagonal R and ρ. Π is the
// projection of friction_law.hpp and bound_laws.hpp; any ρ > 0 has the same solutions.
#pragma once

#include <array>
#include <fork1s/reference/full_contact.hpp>
#include <vector>

#include "contact_constraints.hpp"
#include "friction_law.hpp"

namespace fork1s::reference {

/// Rows of a point; a point that no velocity moves has none.
struct PointBlock {
  int constraint = 0;                            // its place in the constraints
  int row = 0;                                   // normal; the tangents follow
  std::array<int, 3> moment_row = {-1, -1, -1};  // -1: no moment about this axis
  double inverse_mass = 0;                       // mean over the three rows [1/kg]
  int pair = 0;                                  // of ports
};

struct ContactProblem {
  MatrixX W, A;
  VectorX b, c, R, previous;  // previous: x₀
  VectorX inverse_mass;       // per row; one value for the three rows of a point
  VectorX rho;                // 1/(inverse_mass + R)
  VectorX magnitude;          // |J| |v*| + |bias|, for rounding
  std::vector<PointBlock> points;
  std::vector<double> pair_scale, pair_floor;  // of the material's R; least R [m/s per N·s]
  std::vector<double> initial_scale;           // before any load
  std::vector<char> driven_pairs;              // what presses them gives way to no force
  int first_bound = 0;                         // row of the first bound constraint

  int size() const { return static_cast<int>(b.size()); }
};

/// Rows, W and b. InitializePairCompliance and UpdateCompliance add the rest.
ContactProblem AssembleContactProblem(const std::vector<ResponseBlock>& blocks,
                                      const std::vector<PointConstraint>& points,
                                      const std::vector<BoundConstraint>& bounds, const VectorX& velocities);

/// Scale of R for each pair of bodies, one for all of its points. The stiffest of them decides: R is reduced
/// to `max_relative` of the inverse mass, and to that of the material at the normal impulse of the step before.
void InitializePairCompliance(const std::vector<PointConstraint>& points, double max_relative,
                              ContactProblem& problem);
/// R times the normal impulse of the deepest point of each pair [m/s].
std::vector<double> PenetrationSpeeds(const ContactProblem& problem, const VectorX& x);
/// R over that of the material under the normal impulse, of the point of each pair where it is most; 1 up to twice
/// the material's.
std::vector<double> ExcessCompliance(const std::vector<PointConstraint>& points,
                                     const ContactProblem& problem, const VectorX& x);
/// Reduces R of these pairs, but of driven ones. False if there is none.
bool ReducePairCompliance(const std::vector<PointConstraint>& points, const VectorX& x,
                          ContactProblem& problem);
/// R, A, c and ρ from the scales of the pairs.
void UpdateCompliance(const std::vector<PointConstraint>& points, double max_relative,
                      ContactProblem& problem);

/// Replaces the tangential parts of x₀ by the smallest ones with the same effect on the bodies
/// (internal_forces.cpp).
void RelaxInternalForces(const std::vector<PointConstraint>& points, ContactProblem& problem);

/// Π(y), its modes, and the natural residual x - Π(x - ρ g).
struct NaturalMap {
  VectorX g, y, projection;
  std::vector<ContactMode> modes;  // per point
  double residual = 0;             // |x - Π(y)|, weighted by the inverse masses [√(N·m)]
  double rounding = 0;             // of the residual
  double change = 0;               // |W^½ x|: square root of twice the kinetic energy of the impulses
  /// Residual beyond rounding, relative to the change.
  double Relative() const;
};
void EvaluateNaturalMap(const ContactProblem& problem, const std::vector<PointConstraint>& points,
                        const std::vector<BoundConstraint>& bounds, const VectorX& x, NaturalMap& map);

/// Projected block Gauss-Seidel: each point's three rows are solved exactly with the others fixed, then its
/// moments, then the bound constraints; alternating directions.
void SweepGaussSeidel(const ContactProblem& problem, const std::vector<PointConstraint>& points,
                      const std::vector<BoundConstraint>& bounds, int sweeps, VectorX& x);

/// The impulse x with x = Π(x - ρ (A x + c)) for a symmetric, positive definite A (3x3).
/// `shares`: coefficients along the tangents over `friction`; ρ of a tangent is as the square of its share.
Vector3 SolvePointBlock(const Matrix3& A, const Vector3& c, double friction,
                        const Vector2& shares = Vector2::Ones());

/// Damped semismooth Newton on the natural map. Stops at `target`, or where the residual stagnates. x is the
/// best iterate. Returns the number of factorizations.
int IterateNewton(const ContactProblem& problem, const std::vector<PointConstraint>& points,
                  const std::vector<BoundConstraint>& bounds, double target, int max_iterations, VectorX& x);

}  // namespace fork1s::reference
