// Motions and constraints of a mechanism in one unit, so that ranks can be decided (linalg/rank.hpp).
//
// A motion q = scale ∘ x has x = 1 for a turn of a radian and for a slide as long as the loop that it works in.
// Rows that measure a displacement are divided by the distance over which they see turns. Both come from
// distances and magnitudes before anything cancels, so that a row which vanishes but for rounding stays small.
#pragma once

#include <fork1s/mechanism/kinematics.hpp>

namespace fork1s {

struct CoordinateScaling {
  VectorX coordinate;  ///< n: q = coordinate ∘ x
  VectorX closure;     ///< per closure: m, distance from which its joints turn its displacements
};
/// At the pose of `kinematics`.
CoordinateScaling ComputeCoordinateScaling(const Mechanism& mechanism, const Kinematics& kinematics);

/// Rows of rigid closures and couplings on x (num_constraints x n): ClosureJacobian in one unit.
/// `row_scale` receives what each row was multiplied by.
MatrixX ScaledClosureRows(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                          const CoordinateScaling& unit, VectorX* row_scale = nullptr);

/// What stretches the springs: a row for every joint, tendon and closure direction with stiffness, in one unit
/// on x, and its weight, so that the springs hold ½ |diag(weight) rows x|².
struct SpringRows {
  MatrixX rows;            ///< s x n
  VectorX weight;          ///< s: root of stiffness times what a row was divided by
  std::vector<int> joint;  ///< s: coordinate of a row that is a joint's own spring, else -1
};
SpringRows ScaledSpringRows(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                            const CoordinateScaling& unit);

}  // namespace fork1s
