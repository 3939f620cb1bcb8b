// How the errors of closures bend, at constant µ.
#pragma once

#include <fork1s/reduction/expansion.hpp>

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

/// Twists (6 x r) of what stands before a coordinate, and of what a joint carries.
Matrix6X TwistsBefore(const Mechanism& mechanism, const Expansion& expansion, int coordinate);
Matrix6X TwistsBehind(const Mechanism& mechanism, const Expansion& expansion, JointIndex joint);

}  // namespace fork1s::internal
