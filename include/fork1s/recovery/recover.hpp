// From the reduced state to the pose of every body.
//
// docs/method.md, section 2. `exact` composes the joints along every path and closes the loops; `twist` is
// the paper's parallel computation, one exponential a body: X_RB = Exp(T_B z) X_RB(q_ref).
#pragma once

#include <fork1s/reduction/reduced_model.hpp>
#include <string>
#include <vector>

namespace fork1s {

/// Poses of all bodies in the root frame, joints exact and loops as well; where the model has their
/// curvature, by that. `scratch` is reused between calls.
void RecoverPosesExact(const ReducedModel& model, const ReducedState& state, Configuration& scratch,
                       std::vector<RigidTransform>& X_RB);

/// Pose of one body in the root frame by its twist.
RigidTransform RecoverPoseTwist(const ReducedModel& model, const ReducedState& state, BodyIndex body);

/// Poses of all bodies in the root frame by one twist each, in parallel for large mechanisms. Its error grows
/// with the square of the deflection from q_ref: see MeasureJointGaps.
void RecoverPosesTwist(const ReducedModel& model, const ReducedState& state,
                       std::vector<RigidTransform>& X_RB);

/// How far the two sides of a joint or closure stand apart in given poses.
struct JointGap {
  std::string name;
  double gap = 0;  // m
};

/// Separation of every joint's anchor (seen from the parent side and from the child side; for a slide across
/// its axis only, for joints with other freedoms across those) and of every rigid closure, largest first.
std::vector<JointGap> MeasureJointGaps(const Mechanism& mechanism, const std::vector<RigidTransform>& X_RB);

}  // namespace fork1s
