// Poses by one twist a body and by joints, for the recovery tests.
#pragma once

#include <gtest/gtest.h>
#include <fork1s/recovery/recover.hpp>
#include <mechanisms.hpp>

#include <algorithm>

namespace fork1s::testing {

inline double LargestGap(const Mechanism& m, const std::vector<RigidTransform>& X_RB) {
  const auto gaps = MeasureJointGaps(m, X_RB);
  return gaps.empty() ? 0 : gaps.front().gap;
}

inline ReducedModel MustReduce(const std::shared_ptr<const Mechanism>& m, int modes = -1) {
  ReductionOptions options;
  options.modes = modes;
  auto model = Reduce(m, VectorX::Zero(m->num_coordinates()), options);
  if (!model) throw std::runtime_error(model.error().Text());
  return std::move(*model);
}

/// The state along z for which the largest linear joint turn (or slide in lengths of the mechanism) is `angle`.
inline ReducedState Deflected(const ReducedModel& model, const VectorX& z, double angle) {
  ReducedState state;
  const VectorX q = model.Q * z;
  double largest = 0;
  for (int i = 0; i < q.size(); ++i) {
    const bool turns = model.mechanism->screws().col(i).head<3>().norm() > 1e-9;
    largest = std::max(largest, std::abs(q(i)) / (turns ? 1.0 : model.mechanism->length_scale()));
  }
  state.z = z * (angle / largest);
  state.w = VectorX::Zero(z.size());
  return state;
}

}  // namespace fork1s::testing
