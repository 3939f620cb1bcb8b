// Forces on the joint coordinates of a mechanism under dead loads, gravity and controls, and their
// derivative.
#pragma once

#include <fork1s/reduction/statics.hpp>

#include "mechanism/coordinate_scaling.hpp"

namespace fork1s::internal {

/// g(q, λ, s) = springs + controls + s (gravity + dead loads) + Aᵀλ, zero on locked coordinates, whose locks
/// balance it.
class LoadedMechanism {
 public:
  LoadedMechanism(const Mechanism& mechanism, const VectorX& q0, const std::vector<DeadLoad>& loads,
                  const StaticsOptions& options);

  void Pose(const VectorX& q) { ComputeKinematics(mechanism_, q, kinematics_); }
  const Kinematics& kinematics() const { return kinematics_; }
  /// At q0.
  const CoordinateScaling& unit() const { return unit_; }

  /// Gravity and dead loads alone, at the present pose.
  VectorX LoadForce(double share);
  /// g; leaves the mechanism at q.
  VectorX Residual(const VectorX& q, const VectorX& lambda, double share);
  /// Size of the forces that have to balance, in one unit.
  double Scale(const VectorX& q, double share);
  double Size(const VectorX& g) const { return unit_.coordinate.cwiseProduct(g).cwiseAbs().maxCoeff(); }
  /// Rounding of positions times the stiffest spring, in one unit: no smaller forces can balance.
  double rounding() const { return rounding_; }
  /// Loop reactions λ of least norm that balance the other forces best.
  VectorX Reactions(const VectorX& q, double share);
  /// ∂g/∂q at constant λ by central differences, which has the geometric stiffness of loads, prestress and
  /// reactions, and the derivative of ball joints; -1 on the diagonal of locked coordinates. Leaves the
  /// mechanism at q.
  MatrixX Tangent(const VectorX& q, const VectorX& lambda, double share);

 private:
  const Mechanism& mechanism_;
  const std::vector<DeadLoad>& loads_;
  const StaticsOptions& options_;
  Kinematics kinematics_;
  CoordinateScaling unit_;
  double rounding_ = 0;
  Matrix6X F_;
  MatrixX A_;
};

/// Size [N·m] up to which eigenvalues of a tangent stiffness are singular, beside forces of a size (Scale).
double SingularStiffness(const VectorX& eigenvalues, double scale);

}  // namespace fork1s::internal
