#include <fork1s/recovery/recover.hpp>

#include "parallel/parallel_for.hpp"

namespace fork1s {

void RecoverPosesExact(const ReducedModel& model, const ReducedState& state, Configuration& scratch,
                       std::vector<RigidTransform>& X_RB) {
  ConfigurePose(model, state, scratch);
  X_RB = scratch.kinematics.X_RB;
}

RigidTransform RecoverPoseTwist(const ReducedModel& model, const ReducedState& state, BodyIndex body) {
  const int r = model.size();
  // A sum of fixed-size columns: a general product spends more on its set-up than on six rows.
  Vector6 twist = Vector6::Zero();
  const double* column = model.T.data() + static_cast<std::ptrdiff_t>(body.value()) * r * 6;
  for (int k = 0; k < r; ++k, column += 6) twist += Eigen::Map<const Vector6>(column) * state.z(k);
  return Exp(twist) * model.X_RB_ref[body.u()];
}

void RecoverPosesTwist(const ReducedModel& model, const ReducedState& state,
                       std::vector<RigidTransform>& X_RB) {
  const int bodies = model.mechanism->num_bodies();
  X_RB.resize(static_cast<std::size_t>(bodies));
  // About 20 ns a body: ranges below some thousand bodies cost less than waking a thread.
  constexpr int kGrain = 2048;
  ParallelFor(0, bodies, kGrain, [&](int begin, int end) {
    for (int b = begin; b < end; ++b)
      X_RB[static_cast<std::size_t>(b)] = RecoverPoseTwist(model, state, BodyIndex(b));
  });
}

}  // namespace fork1s
