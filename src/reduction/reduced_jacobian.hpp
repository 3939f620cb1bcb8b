// The reduced body Jacobians at a pose, and the inertia they make.
#pragma once

#include <fork1s/base/quad.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <vector>

#include "mechanism/rigid_parts.hpp"

namespace fork1s {

/// T_j = Σ S_i Q_i over the path to joint j: the twist of what joint j carries, in R about R's origin, per
/// rate of z. Only the columns that reach a joint are kept: with fingers on a held palm those of one finger.
class ReducedJacobian {
 public:
  explicit ReducedJacobian(const ReducedModel& model);

  /// At the pose of `c`. O(joints x columns that reach them), no allocation.
  void Compute(const ReducedModel& model, const Configuration& c);
  /// Columns [begin, begin + size) that move joint j.
  int begin(int joint) const { return run(joint).begin; }
  int size(int joint) const { return run(joint).size; }
  /// 6 x size(joint)
  auto T(int joint) const {
    const Run& at = run(joint);
    return Eigen::Map<const Rows, 0, Eigen::OuterStride<>>(T_.data() + at.at + at.begin - at.first, 6,
                                                           at.size, Eigen::OuterStride<>(at.padded));
  }

 private:
  friend class ReducedInertia;
  using Rows = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::RowMajor>;
  // Rows of T stand in fours of columns, the same fours for all joints and 0 where they are none of the
  // run's, so that arithmetic goes four at a time without ends.
  struct Run {
    int begin = 0, size = 0;
    int first = 0, padded = 0;         // multiples of four
    int coordinate = 0, freedoms = 0;  // of the joint
    int previous = -1;                 // the joint before
    int up_begin = 0, up_end = 0;      // the fours of that one, counted from `first`
    Eigen::Index at = 0, up_at = 0;    // in T_: six rows of padded length, and those of the joint before
    Eigen::Index Q_at = 0;             // in Q_: the joint's rows of Q_now on the fours of its run
  };
  // Coordinates one after the other whose rows of Q_ stand on the same fours.
  struct Band {
    int coordinate = 0, rows = 0;  // the first, and how many
    int first = 0, padded = 0;
    Eigen::Index at = 0;  // in Q_
  };
  const Run& run(int joint) const { return runs_[static_cast<std::size_t>(joint)]; }

  void LoadRows(const RowMatrixX& Q);

  std::vector<Run> runs_;  // per joint
  std::vector<Band> bands_;
  std::vector<int> reach_;  // per column: where what moves with it in some joint ends
  std::vector<double> T_, Q_;
};

/// M_zz = Σ Tᵀ I T + Qᵀ Eᵀ diag(armature) E Q (r x r), E the map to joint velocities ν (kinematics.hpp), M_00 = Σ I at a
/// pose and, where the base moves, M_0z = Σ I T (6 x r), all in R about R's origin, by inertias of all that a joint carries (Featherstone, Rigid Body Dynamics Algorithms, 6.2).
class ReducedInertia {
 public:
  explicit ReducedInertia(const ReducedModel& model);

  /// At the pose of `c`, with the Jacobians there. Entries of M_zz of coordinates that no part shares are 0 at any
  /// pose and not written (ClearApart). O(joints x columns that reach them, squared), no allocation. Nothing feels M_0z of a fixed base: it stays.
  void Compute(const ReducedModel& model, const RigidParts& parts, const Configuration& c,
               const ReducedJacobian& jacobian, Eigen::Ref<MatrixX> M_zz, Matrix6X& M_0z, Matrix6& M_00);
  /// 0 in M_zz (r x r) wherever Compute does not write.
  static void ClearApart(const ReducedJacobian& jacobian, Eigen::Ref<MatrixX> M_zz);

 private:
  // About R's origin, so that inertias add; of every four numbers the last means nothing.
  struct Sum {
    Quad rotational[3];  // columns
    Quad moment;         // mass times centre
    double mass;

    void Clear();
    void Add(const RigidTransform& X, const SpatialInertia& I);
    void Add(const Sum& other);
    // Of a twist its momentum.
    void Apply(const double* twist, double* momentum) const;
  };
  void ComputeMomenta(const ReducedModel& model, const RigidParts& parts, const Configuration& c,
                      const ReducedJacobian& jacobian, Matrix6& M_00);
  bool FillArmature(const Mechanism& mechanism, const Kinematics& kinematics, int joint_index);
  void AddBands(const ReducedJacobian& jacobian);

  Matrix6 armature_;       // of one joint
  std::vector<Sum> sums_;  // per joint
  int padded_ = 0;         // r in whole fours
  bool base_moves_ = false;
  // Per coordinate f, and h as the Jacobian has its row of Q; half of M_zz, and M_0z by rows.
  std::vector<double> f_, h_, half_, M_0z_;
};

}  // namespace fork1s
