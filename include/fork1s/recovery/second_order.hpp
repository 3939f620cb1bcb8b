// One twist a body with the next term of its series.
//
// docs/method.md, section 2. With x_j = S_j δq_j the screw of joint j times its displacement since the
// reference, δq = Q z, the product of exponentials along a path has the Magnus series
//     log(Exp(x_1) Exp(x_2) ... Exp(x_k)) = Σ x_i + ½ Σ_{i<j} [x_i, x_j] + O(x³).
// The first term alone is RecoverPosesTwist. At a reference other than q = 0 the screw of a joint of several
// freedoms is that of its rate there, which is right to first order only.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>
#include <vector>

namespace fork1s {

/// Poses of all bodies in the root frame by one exponential each, of both terms. Loops are not closed. Its
/// error grows with the third power of the deflection from q_ref.
void RecoverPosesTwistSecondOrder(const ReducedModel& model, const ReducedState& state,
                                  std::vector<RigidTransform>& X_RB);

}  // namespace fork1s
