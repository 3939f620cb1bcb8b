// Static deflection under dead loads, linear and nonlinear.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>
#include <vector>

namespace fork1s {

/// A force and moment of fixed direction in R at a point of a body.
struct DeadLoad {
  BodyIndex body;
  Vector3 force_R = Vector3::Zero();   // N
  Vector3 moment_R = Vector3::Zero();  // N·m
  Vector3 point_B = Vector3::Zero();   // m, where the force acts, from the body's origin
};

struct StaticsOptions {
  Vector3 gravity_R = Vector3::Zero();  // m/s²
  VectorX controls;                     // empty: all zero
  std::vector<int> locked;   // joint coordinates that stay at the start (compliance.hpp, CoordinatesToLock)
  int load_steps = 8;        // the first step along the path raises the load by one part in these
  int max_iterations = 60;   // Newton steps per step along the path
  double tolerance = 1e-11;  // of the residual, relative to the largest force in it
};

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

struct StaticsResult {
  VectorX q;  // joint displacements
  bool converged = false;
  double share = 0;  // of the load, that was reached: 1 where it converged
  /// Shares of the load at the limit points (folds) that the path of equilibria passed on the way, in its
  /// order. Empty: q is on the primary branch, reached as the load grows.
  std::vector<double> limit_shares;
  int iterations = 0;
  double residual = 0;       // relative
  TangentStiffness tangent;  // at q, where it converged
};

/// Equilibrium of springs, closures and loads with the base held: the first one at the whole load on the path
/// of equilibria that begins at the unloaded start q0, followed by arc length, beyond limit points too.
/// Newton on joint coordinates and closure reactions, the tangent re-taken at every pose: the point that
/// repeated refreshing of a reduced model converges to.
StaticsResult SolveStatics(const Mechanism& mechanism, const VectorX& q0, const std::vector<DeadLoad>& loads,
                           const StaticsOptions& options = {});

/// Linear response at q0 to loads, gravity, controls and spring preload: q0 + Z V Vᵀ Zᵀ g. Where they do work
/// on motions that no spring resists, the tangent stiffness under gravity, controls and preload is taken
/// instead. Errors: kUnderdetermined where that is singular for the load.
Expected<VectorX> LinearDeflection(const Mechanism& mechanism, const VectorX& q0,
                                   const std::vector<DeadLoad>& loads, const StaticsOptions& options = {});

/// Largest turn [rad] of any hinge or ball between q0 and q.
double MaxJointRotation(const Mechanism& mechanism, const VectorX& q0, const VectorX& q);

}  // namespace fork1s
