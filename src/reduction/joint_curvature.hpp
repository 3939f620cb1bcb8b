// What joints of several freedoms add to second derivatives of poses and of joint velocities.
#pragma once

#include <fork1s/mechanism/kinematics.hpp>
#include <vector>

namespace fork1s::internal {

/// Of coordinates a <= b of one joint of several freedoms: the second derivative of its motion, in R about R's origin,
/// beyond that of two screws one after the other. It adds `second` (q_a q_bᵀ + q_b q_aᵀ), or `second` q_a q_aᵀ, to A of
/// what the joint carries.
struct JointCurvature {
  int a = 0, b = 0;
  Vector6 second;
};
/// Of all joints of several freedoms, at q.
std::vector<JointCurvature> JointCurvatures(const Mechanism& mechanism, const Kinematics& kinematics,
                                            const VectorX& q);

/// ∂E/∂θ_c at q, E of AngularVelocityMap.
Matrix3 TurnOfVelocityMap(const Mechanism::Rotation& rotation, const VectorX& q, int c);

}  // namespace fork1s::internal
