// The reduced body Jacobians at a pose, and the inertia they make.
#pragma once

#include <fork1s/mechanism/rigid_parts.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <vector>

namespace fork1s {

/// T_j = Σ S_i Q_i over the path to joint j: the twist of what joint j carries, in R about R's origin, per
/// rate of z. Only the columns that reach a joint are kept: with fingers on a held palm those of one finger.
class ReducedJacobian {
 public:
  explicit ReducedJacobian(const ReducedModel& model);

  /// At the pose of `c`. O(joints x columns that reach them), no allocation.
  void Compute(const ReducedModel& model, const Configuration& c);
  /// Columns [begin, begin + size) that move joint j.
  int begin(int joint) const { return runs_[static_cast<std::size_t>(joint)].begin; }
  int size(int joint) const { return runs_[static_cast<std::size_t>(joint)].size; }
  /// 6 x size(joint)
  auto T(int joint) const {
    const Run& run = runs_[static_cast<std::size_t>(joint)];
    return T_.middleCols(run.at, run.size);
  }

 private:
  struct Run {
    int begin = 0, size = 0;
    Eigen::Index at = 0;  // first column in T_
  };
  std::vector<Run> runs_;  // per joint
  Matrix6X T_;
};

/// M_zz = Σ Tᵀ I T + Qᵀ diag(armature) Q (r x r), M_0z = Σ I T (6 x r), M_00 = Σ I at the pose of `c`.
/// Entries of coordinates that no part shares stay exactly 0. No allocation.
void ReducedInertia(const ReducedModel& model, const RigidParts& parts, const Configuration& c,
                    const ReducedJacobian& jacobian, Eigen::Ref<MatrixX> M_zz, Matrix6X& M_0z, Matrix6& M_00);

}  // namespace fork1s
