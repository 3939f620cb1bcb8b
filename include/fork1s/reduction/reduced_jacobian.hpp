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

/// M_zz = Σ Tᵀ I T + Qᵀ diag(armature) Q (r x r), M_0z = Σ I T (6 x r), M_00 = Σ I at a pose, all in R about
/// R's origin, by inertias of all that a joint carries (Featherstone, Rigid Body Dynamics Algorithms, 6.2).
class ReducedInertia {
 public:
  explicit ReducedInertia(const ReducedModel& model);

  /// At the pose of `c`, with the Jacobians there. Entries of coordinates that no part shares stay exactly 0.
  /// O(joints x columns that reach them, squared), no allocation.
  void Compute(const ReducedModel& model, const RigidParts& parts, const Configuration& c,
               const ReducedJacobian& jacobian, Eigen::Ref<MatrixX> M_zz, Matrix6X& M_0z, Matrix6& M_00);

 private:
  // About R's origin, so that inertias add.
  struct Sum {
    double mass = 0;
    Vector3 moment = Vector3::Zero();  // mass times centre
    Matrix3 rotational = Matrix3::Zero();

    void Add(const SpatialInertia& I);
    void Add(const Sum& other);
    Vector6 operator*(const Vector6& V) const;
  };
  std::vector<Sum> sums_;  // per joint
  VectorX q_, h_;
};

}  // namespace fork1s
