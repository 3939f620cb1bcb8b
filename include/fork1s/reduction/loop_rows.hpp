// The rows that keep loops closed, each with the few coordinates that it depends on: docs/method.md, section 2.
#pragma once

#include <fork1s/linalg/multifrontal_lu.hpp>
#include <fork1s/mechanism/kinematics.hpp>
#include <vector>

namespace fork1s {

/// Independent rows of the closure Jacobian A = ∂c/∂q by closure: a closure depends on the coordinates between its
/// two bodies and no others. Closures that share none, over however many others, form groups of their own,
/// which are factored apart. Holds where values stand; the values of a pose are arrays of the caller.
class LoopRows {
 public:
  LoopRows() = default;
  /// `rows`: those of ClosureJacobian that are kept.
  LoopRows(const Mechanism& mechanism, const std::vector<int>& rows);

  int size() const { return static_cast<int>(rows_.size()); }
  /// Number of values of the rows at a pose.
  Eigen::Index num_values() const { return num_values_; }
  /// Which row of ClosureResidual and ClosureJacobian stands at i.
  int row(int i) const { return rows_[static_cast<std::size_t>(i)]; }

  /// ∂c/∂q at a pose.
  void Fill(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
            VectorX& values) const;
  /// values <- values diag(h): every coordinate's times its own.
  void ScaleCoordinates(const VectorX& h, VectorX& values) const;
  /// y = A x [m]
  void Apply(const VectorX& A, const VectorX& x, VectorX& y) const;
  /// Y = A X in the first columns of Y, which may have more; those are 0 then.
  void Apply(const VectorX& A, const RowMatrixX& X, RowMatrixX& Y) const;
  /// x -= Aᵀ y
  void SubtractTransposed(const VectorX& A, const VectorX& y, VectorX& x) const;
  /// X -= Aᵀ Y by as many columns as X has.
  void SubtractTransposed(const VectorX& A, const RowMatrixX& Y, RowMatrixX& X) const;

  /// Coordinates that depend on each other through loops, group by group.
  std::vector<std::vector<int>> GroupCoordinates() const;
  /// Rows of each such group, which stand together in the same order.
  std::vector<int> GroupSizes() const;

 private:
  friend class LoopFactor;
  struct Block {     // of one closure or coupling
    int source = 0;  // closure, or closures + coupling
    int begin = 0;   // its first row here
    int rows = 0;
    int component[6];     // of the closure, by row
    int coordinates = 0;  // begin in coordinates_
    int count = 0;        // of coordinates
    int stride = 0;       // of its values from coordinate to coordinate: rows in whole fours
    Eigen::Index at = 0;  // of its values: coordinate by coordinate, rows together
  };
  struct Shared {  // values of a coordinate that two blocks depend on
    Eigen::Index a, b;
  };
  struct Pair {
    int block_a, block_b;
    int first, last;  // in shared_
  };
  struct Group {
    int begin = 0, size = 0;  // rows
  };

  std::vector<int> rows_;
  std::vector<Block> blocks_;
  std::vector<int> coordinates_;
  std::vector<Shared> shared_;
  std::vector<Pair> pairs_;
  std::vector<Group> groups_;
  Eigen::Index num_values_ = 0;
};

/// LU of A Bᵀ for two sets of values on the same rows. Blocks of closures that share no coordinate are 0 and cost nothing.
class LoopFactor {
 public:
  LoopFactor() = default;
  explicit LoopFactor(const LoopRows& rows);
  /// Whether A Bᵀ had an inverse at the last Compute; what Solve gives is not a number where it had none.
  bool ok() const { return ok_; }
  void Compute(const LoopRows& rows, const VectorX& A, const VectorX& B);
  /// x <- (A Bᵀ)⁻¹ x
  void SolveInPlace(VectorX& x) const;
  void SolveInPlace(RowMatrixX& x) const;
  /// x <- (A Bᵀ)⁻ᵀ x
  void SolveTransposedInPlace(VectorX& x) const;

 private:
  MultifrontalLu lu_;
  std::vector<MultifrontalLu::Place> places_;  // per pair of blocks
  bool ok_ = false;
};

}  // namespace fork1s
