// The equations of motion of a reduced mechanism to first order about its start, as matrices with names and units.
#pragma once

#include <string>
#include <vector>

#include "study/posed_mechanism.hpp"

namespace fork1s {

struct Signals {
  std::vector<std::string> names, units;
};

/// M p'' + D p' + K p = f + B u,   y = C p.
/// p, s coordinates: the r reduced ones of the model, of unit 1, in which K is 0 or 1 J; then of a base that floats its
/// rotation vector [rad] and the displacement of its origin [m], world axes. A fixed or driven base is held.
/// u, m inputs: changes of the controls, then of every interface body the moment about its origin [N m] and the force
/// there [N], world axes. y, l outputs: of every interface body its rotation vector [rad] and the displacement of its
/// origin [m], world axes, then all joint coordinates [rad or m].
/// Stiffness is that of springs and set-points; the geometric stiffness of weight and preload, limits, bounds of
/// forces, dry friction and contact are left out.
struct LinearModel {
  std::string mechanism;
  MatrixX M, D, K;  // s x s
  MatrixX B;        // s x m
  MatrixX C;        // l x s
  VectorX f;        // s: force at the start of weight, springs and controls; 0 at rest
  Signals coordinates, inputs, outputs;
  VectorX u_ref;   // m: controls at the start, 0 for wrenches
  VectorX q_ref;   // n: joint coordinates at the start
  Signals joints;  // n
  std::vector<std::string> interfaces;
  std::vector<RigidTransform> X_WB_ref;  // of each of these at the start
};

LinearModel ComputeLinearModel(const PosedMechanism& posed, const ReducedModel& model);

/// x' = A x + B u + c,   y = C x + D u,   x = [p, p'], D = 0.
struct StateSpace {
  MatrixX A, B, C, D;
  VectorX c;
  Signals states, inputs, outputs;
};

/// Errors: kNumerics where M is not positive definite.
Expected<StateSpace> ToStateSpace(const LinearModel& model);

/// As a MAT-file (.mat) or an NPZ file (.npz), arrays by the names above; docs/formats.md lists them. Errors: kFile.
Expected<void> SaveLinearModel(const LinearModel& model, const std::string& path);

}  // namespace fork1s
