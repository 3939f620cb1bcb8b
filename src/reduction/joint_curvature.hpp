// What joints of several freedoms add to second derivatives of poses and of joint velocities.
#pragma once

#include <fork1s/reduction/expansion.hpp>

namespace fork1s::internal {

/// Of all joints of several freedoms, at q.
std::vector<JointCurvature> JointCurvatures(const Mechanism& mechanism, const Kinematics& kinematics,
                                            const VectorX& q);

/// ∂E/∂θ_c at q, E of AngularVelocityMap.
Matrix3 TurnOfVelocityMap(const Mechanism::Rotation& rotation, const VectorX& q, int c);

}  // namespace fork1s::internal
