// Constraints of one contact solve, and the operators that respond to them.
//
// Impulses p change the stacked velocities by v = v* + W p, W = J A⁻¹ Jᵀ block by block.
#pragma once

#include <cmath>
#include <fork1s/base/types.hpp>
#include <limits>

namespace fork1s::reference {

using PointJacobian = Eigen::Matrix<double, 3, 6>;

/// Velocities of one mechanism or free body.
struct ResponseBlock {
  int offset = 0;  // of its first row in the stacked velocities
  MatrixX W;       // symmetric, positive semidefinite
};

struct PointConstraint {
  // First row of the twist [ω; v] of either body in the stacked velocities; -1: fixed to the world.
  int port_a = -1, port_b = -1;
  // Relative velocity = J_a v[port_a] + J_b v[port_b]; rows: normal, two tangents. The linear part of J is ±
  // the contact frame, so the same part gives the relative angular velocity about the three axes.
  PointJacobian J_a = PointJacobian::Zero(), J_b = PointJacobian::Zero();
  Vector3 bias = Vector3::Zero();                        // m/s
  double spin = 0;                                       // rad/s, added to what turns about the normal
  double friction = 0, torsion = 0, rolling = 0;         // µ; radii [m]
  Vector2 friction_scale = Vector2::Ones();              // coefficients along the tangents as shares of µ
  double compliance_normal = 0, compliance_tangent = 0;  // m/s per N·s
  double hardening_speed = std::numeric_limits<double>::infinity();  // m/s
  // Of the step before, in this frame.
  Vector3 previous_impulse = Vector3::Zero(), previous_moment = Vector3::Zero();  // N·s, N·m·s
  double previous_utilization = 0;
  // In: initial guess; out: solution.
  Vector3 impulse = Vector3::Zero(), moment = Vector3::Zero();
  /// Out: tangential impulse without the bound of friction over that bound. Above 1 the point slides.
  double utilization = 0;

  /// The larger of the two coefficients, and both as shares a of it. A tangent without friction keeps 1e-9.
  double LargestFriction() const { return friction * friction_scale.maxCoeff(); }
  Vector2 FrictionShares() const {
    const double largest = friction_scale.maxCoeff();
    return largest > 0 ? Vector2((friction_scale / largest).cwiseMax(1e-9)) : Vector2(Vector2::Ones());
  }
  /// Compliance of the normal under an impulse as a share of compliance_normal: beyond hardening_speed the impulse grows
  /// with the power kHardening of the penetration.
  static constexpr double kHardening = 8;
  double LoadedScale(double normal_impulse) const {
    const double linear = normal_impulse * compliance_normal;
    return linear > hardening_speed ? std::pow(linear / hardening_speed, 1 / kHardening - 1) : 1;
  }
  double Radius(int axis) const { return axis == 0 ? torsion : rolling; }
  /// Impulse [moment; force] on the body whose Jacobian is J.
  Vector6 ImpulseOn(const PointJacobian& J) const {
    Vector6 p = J.transpose() * impulse;
    p.head<3>() += J.rightCols<3>().transpose() * moment;
    return p;
  }
};

/// w = sign · v[row] + bias with an impulse along `sign` between two bounds.
struct BoundConstraint {
  int row = 0;
  double sign = 1, bias = 0;
  double lower = 0, upper = std::numeric_limits<double>::infinity();  // N·s or N·m·s
  double previous_impulse = 0;
  double impulse = 0;  // in: initial guess; out: solution
  // Above 0: a bias below 0 is reduced to where the impulse that it takes is at most this mass times it [kg].
  double recovery_mass = 0;
};

}  // namespace fork1s::reference
