// A state alone, as every other part of the program has it.
#pragma once

#include <fork1s/recovery/pose_arrays.hpp>
#include <vector>

namespace fork1s::internal {

/// For states whose loops do not close side by side; nothing in models without loops.
class OneByOne {
 public:
  OneByOne() = default;
  /// A model without curvature is kept; loops are closed to `closed`.
  OneByOne(const ReducedModel& model, double closed);
  bool exists() const { return model_ != nullptr; }
  std::vector<RigidTransform> Recover(const VectorX& z, LoopClosing& closing) const;

 private:
  std::shared_ptr<const ReducedModel> model_;
  double closed_ = 0;
};

}  // namespace fork1s::internal
