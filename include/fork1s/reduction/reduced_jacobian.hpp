// The reduced body Jacobians at a pose, and the inertia they make.
#pragma once

#include <array>
#include <fork1s/base/quad.hpp>
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
    int first = 0, padded = 0;  // multiples of four
    Eigen::Index at = 0;        // in T_: six rows of padded length
  };
  const Run& run(int joint) const { return runs_[static_cast<std::size_t>(joint)]; }
  // A row of Q_now on the fours of its joint's run.
  const double* Q(int coordinate) const { return Q_.data() + Q_at_[static_cast<std::size_t>(coordinate)]; }

  std::vector<Run> runs_;           // per joint
  std::vector<Eigen::Index> Q_at_;  // per coordinate
  std::vector<double> T_, Q_;
};

/// M_zz = Σ Tᵀ I T + Qᵀ diag(armature) Q (r x r), M_0z = Σ I T (6 x r), M_00 = Σ I at a pose, all in R about
/// R's origin, by inertias of all that a joint carries (Featherstone, Rigid Body Dynamics Algorithms, 6.2).
class ReducedInertia {
 public:
  explicit ReducedInertia(const ReducedModel& model);

  /// At the pose of `c`, with the Jacobians there. Entries of M_zz of coordinates that no part shares are 0 at any
  /// pose and not written (ClearApart). O(joints x columns that reach them, squared), no allocation.
  void Compute(const ReducedModel& model, const RigidParts& parts, const Configuration& c,
               const ReducedJacobian& jacobian, Eigen::Ref<MatrixX> M_zz, Matrix6X& M_0z, Matrix6& M_00);
  /// 0 in M_zz (r x r) wherever Compute does not write.
  void ClearApart(Eigen::Ref<MatrixX> M_zz) const;

 private:
  // About R's origin, so that inertias add. Four numbers a column: the fourth of the moments is the mass, that of
  // the others means nothing.
  struct Sum {
    std::array<Quad, 3> rotational = {Quad::Zero(), Quad::Zero(), Quad::Zero()};
    Quad moment = Quad::Zero();  // mass times centre

    double mass() const { return moment[3]; }
    // The inertia I at the pose X = 1, after it has moved by X.
    void Add(const RigidTransform& X, const SpatialInertia& I);
    void Add(const Sum& other);
    Vector6 operator*(const Vector6& V) const;
  };
  void ClearBelow();
  void AddSymmetric(const double* q, int first, int padded);

  std::vector<Sum> sums_;   // per joint
  std::vector<int> below_;  // per column of M_zz: the end of what any part has in it at or below the diagonal
  int padded_ = 0;          // r in whole fours
  std::vector<double> h_, M_zz_, M_0z_;
};

}  // namespace fork1s
