// Where a contact goes while one surface rolls and slides on the other.
#pragma once

#include <fork1s/collision/collision_world.hpp>

namespace fork1s {

/// Curvatures [1/m] of both surfaces at a contact, on the tangents of its frame (rows 1 and 2), convex
/// positive.
struct PairCurvature {
  Eigen::Matrix2d a = Eigen::Matrix2d::Zero(), b = Eigen::Matrix2d::Zero();
  bool known = true;  // false where a facet and a corner cannot be told apart
};
PairCurvature CurvatureOf(const GeometryDef& a, const RigidTransform& X_WA, const GeometryDef& b,
                          const RigidTransform& X_WB, const ContactPoint& point);

/// (κ_a + κ_b)⁻¹ [m], and the projector on directions in which flat lies on flat, where that inverse is zero.
struct CurvatureInverse {
  Eigen::Matrix2d inverse = Eigen::Matrix2d::Zero(), flat = Eigen::Matrix2d::Identity();
};
CurvatureInverse InverseOf(const PairCurvature& curvature);

/// Of the material of a body where its surface is touched, world axes.
struct MaterialMotion {
  Vector3 omega = Vector3::Zero(), velocity = Vector3::Zero();
};
struct ContactMotion {
  Vector3 velocity = Vector3::Zero();  // of the contact point, m/s
  Vector3 omega = Vector3::Zero();     // of its normal, without spin, rad/s
};
/// D. J. Montana, The kinematics of contact and grasp, IJRR 7(3), 1988, in world axes: with normal n from a
/// to b, slip s = v_b - v_a along the surface and the point's velocities u_a, u_b over the two materials,
///   κ_a u_a + κ_b u_b = (ω_b - ω_a) x n,   u_a - u_b = s,
///   ċ = v_a + u_a,   ṅ = ω_a x n + κ_a u_a.   docs/method.md, (6.3).
/// Linear in the motions. `inverse`: InverseOf(curvature).
ContactMotion MotionOf(const PairCurvature& curvature, const CurvatureInverse& inverse, const Matrix3& frame,
                       const MaterialMotion& a, const MaterialMotion& b);

}  // namespace fork1s
