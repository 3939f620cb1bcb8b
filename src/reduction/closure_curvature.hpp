// How the errors of closures bend, at constant µ.
#pragma once

#include "reduction/expansion.hpp"

namespace fork1s::internal {

/// D²c = ∂²c/∂z² at fixed µ, of all rows of ClosureResidual [num_constraints x r²], by the twists of the
/// expansion.
MatrixX ClosureCurvature(const ReducedModel& model, const Kinematics& kinematics, const VectorX& q,
                         const Expansion& expansion);

/// What springy closures add to the slope of forces (r x r) by their bending, at the load that they bear.
MatrixX SpringyClosureSlope(const ReducedModel& model, const Kinematics& kinematics,
                            const Expansion& expansion);

/// A of a body without loops' q'' (6r x r), as BodyExpansion has it.
MatrixX OpenCurvature(const ReducedModel& model, const Expansion& expansion, BodyIndex body);

/// Twists (6 x r) of what a joint carries, of what stands on R where it is negative.
inline auto TwistsBehind(const Mechanism& mechanism, const Expansion& expansion, int joint) {
  const auto r = expansion.z.size();
  int block = 0;
  if (joint >= 0) {
    const Mechanism::Joint& last = mechanism.joint(JointIndex(joint));
    block = last.offset + last.size;
  }
  return expansion.T.middleCols(block * r, r);
}
/// Of what stands before a coordinate.
inline auto TwistsBefore(const Mechanism& mechanism, const Expansion& expansion, int coordinate) {
  const auto r = expansion.z.size();
  const Mechanism::Joint& joint = mechanism.joint(mechanism.CoordinateJoint(coordinate));
  if (coordinate > joint.offset) return expansion.T.middleCols(coordinate * r, r);
  return TwistsBehind(mechanism, expansion, joint.previous);
}

}  // namespace fork1s::internal
