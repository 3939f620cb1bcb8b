// How the directions that keep loops closed turn with the pose, to first order: docs/method.md, section 2.
#pragma once

#include <fork1s/base/types.hpp>
#include <vector>

namespace fork1s {

struct ReducedModel;

/// N = ∂²µ/∂z² at the reference [m x r x r, symmetric in the last two], of q = q_ref + Q z - B µ with loops
/// closed: c = 0 to second order in z asks for µ = ½ N[z, z], N = (A_ref B)⁻¹ D²c[Q, Q]. Rows of loops that
/// depend on each other have the columns that move those.
class LoopCurvature {
 public:
  LoopCurvature() = default;
  /// By differences of A along each column of Q: r kinematics, N to some 1e-6 of its size.
  explicit LoopCurvature(const ReducedModel& model);
  /// Whether there is one: not of a model without loops, nor unless it was asked for.
  bool exists() const { return !groups_.empty(); }
  /// W = N z = ∂µ/∂z, in the first columns of W [m x r or more]; µ = ½ W z. No allocation.
  void Apply(const VectorX& z, RowMatrixX& W) const;

 private:
  struct Group {
    int row = 0, rows = 0, column = 0, columns = 0;
    // Row by row of W, four of its columns at a time: what each column of z adds to them.
    std::vector<double> N;
  };
  std::vector<Group> groups_;
};

}  // namespace fork1s
