#include <fork1s/recovery/second_order.hpp>

namespace fork1s {

void RecoverPosesTwistSecondOrder(const ReducedModel& model, const ReducedState& state,
                                  std::vector<RigidTransform>& X_RB) {
  const Mechanism& m = *model.mechanism;
  const VectorX dq = model.Q * state.z;
  // Both sums up to and including a joint follow from those of the joint before it.
  struct Sums {
    Vector6 first = Vector6::Zero(), second = Vector6::Zero();
  };
  std::vector<Sums> sums(static_cast<std::size_t>(m.num_joints()));
  for (std::size_t j = 0; j < sums.size(); ++j) {
    const Mechanism::Joint& joint = m.joints()[j];
    if (joint.previous >= 0) sums[j] = sums[static_cast<std::size_t>(joint.previous)];
    const Vector6 x = model.S_ref.middleCols(joint.offset, joint.size) * dq.segment(joint.offset, joint.size);
    sums[j].second += 0.5 * Bracket(sums[j].first, x);
    sums[j].first += x;
  }
  X_RB.resize(static_cast<std::size_t>(m.num_bodies()));
  for (std::size_t b = 0; b < X_RB.size(); ++b) {
    const int last = m.bodies()[b].last_joint;
    X_RB[b] = model.X_RB_ref[b];
    if (last < 0) continue;
    const Sums& s = sums[static_cast<std::size_t>(last)];
    X_RB[b] = Exp(Vector6(s.first + s.second)) * model.X_RB_ref[b];
  }
}

}  // namespace fork1s
