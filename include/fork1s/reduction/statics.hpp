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
  std::vector<int> locked;  // joint coordinates that stay at the start (compliance.hpp, CoordinatesToLock)
  int load_steps = 8;                   // the load is raised from zero in these steps, halved where one fails
  int max_iterations = 60;              // Newton steps per load step
  double tolerance = 1e-11;             // of the residual, relative to the largest force in it
};

struct StaticsResult {
  VectorX q;  // joint displacements
  bool converged = false;
  int iterations = 0;
  double residual = 0;  // relative
  bool stable = true;   // no negative eigenvalue of the tangent stiffness (TangentStiffness)
  double lowest_stiffness = 0;  // N·m, its lowest eigenvalue
};

/// Equilibrium of springs, closures and loads with the base held, on the branch reached by raising the load
/// from the unloaded start q0. Newton on joint coordinates and closure reactions, the tangent re-taken at
/// every pose: the point that repeated refreshing of a reduced model converges to.
StaticsResult SolveStatics(const Mechanism& mechanism, const VectorX& q0, const std::vector<DeadLoad>& loads,
                           const StaticsOptions& options = {});

/// Linear response at q0 to loads, gravity, controls and spring preload: q0 + Z V Vᵀ Zᵀ g. Errors as for
/// Reduce where a spring-free motion takes the load.
Expected<VectorX> LinearDeflection(const Mechanism& mechanism, const VectorX& q0,
                                   const std::vector<DeadLoad>& loads, const StaticsOptions& options = {});

/// Largest turn [rad] of any hinge or ball between q0 and q.
double MaxJointRotation(const Mechanism& mechanism, const VectorX& q0, const VectorX& q);

}  // namespace fork1s
