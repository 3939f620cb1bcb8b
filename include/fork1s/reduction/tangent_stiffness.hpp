// Stiffness about a loaded equilibrium, and the compliance and frequencies that it makes.
#pragma once

#include <fork1s/reduction/compliance.hpp>
#include <fork1s/reduction/statics.hpp>
#include <vector>

namespace fork1s {

/// K_t = ∂²/∂q² (potential energy − λᵀc) on the motions that keep loops closed: the stiffness of springs and
/// the geometric stiffness of gravity, dead loads, controls, prestress and loop reactions. In its
/// eigenvectors x (q = unit ∘ x: radians, and lengths of the mechanism or of a loop for slides) it is
/// diagonal.
struct TangentStiffness {
  VectorX eigenvalues;   ///< N·m, ascending
  MatrixX eigenvectors;  ///< n x k, displacements of joints, of length 1 in one unit
  double zero = 0;       ///< N·m: eigenvalues up to this size are singular

  double lowest() const { return eigenvalues.size() > 0 ? eigenvalues(0) : 0; }
  int num_negative() const { return static_cast<int>((eigenvalues.array() < -zero).count()); }
  /// No negative eigenvalue.
  bool IsStable() const { return num_negative() == 0; }
  /// Motions of no stiffness: n x their number.
  MatrixX SingularMotions() const;
  /// Displacements [n] under joint forces g, none along motions of no stiffness.
  VectorX Solve(const VectorX& g) const;
};

/// At joint displacements q, an equilibrium under the loads (SolveStatics). Locked coordinates stay at rest.
TangentStiffness ComputeTangentStiffness(const Mechanism& mechanism, const VectorX& q,
                                         const std::vector<DeadLoad>& loads, const StaticsOptions& options);

/// Lowest `count` natural frequencies [Hz] of small vibrations about a stable equilibrium q, the base held,
/// motions of no stiffness left out; empty where it is unstable.
std::vector<double> TangentFrequencies(const Mechanism& mechanism, const VectorX& q,
                                       const TangentStiffness& tangent, int count = 8);

/// A point of a body that loads act on.
struct BodyPoint {
  BodyIndex body;
  Vector3 p_B = Vector3::Zero();  // m, from the body's origin
};
/// Displacement [rotation; translation] of each point per load [moment; force] on each, world axes, about the
/// equilibrium q, the base held: C = J K_t⁻¹ Jᵀ. Where a motion of no stiffness moves a point, as `free` has
/// it, C is empty.
InterfaceCompliance TangentCompliance(const Mechanism& mechanism, const VectorX& q,
                                      const TangentStiffness& tangent, const std::vector<BodyPoint>& points);

}  // namespace fork1s
