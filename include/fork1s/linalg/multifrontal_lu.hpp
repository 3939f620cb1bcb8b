// LU of matrices with fixed zero blocks.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace fork1s {

/// P A = L U of a square matrix of blocks, many of which are 0 at fixed places, by dense frontal matrices (Duff and
/// Reid, The multifrontal solution of unsymmetric sets of linear equations, 1984). Each front eliminates blocks that
/// couple with the same others; the order has minimum degree. A pivot is the diagonal entry unless it is below a tenth
/// of the largest entry in its column among the front's own rows; then that one.
///
/// Construction allocates, nothing else does. A factor must not be used by two threads at once.
class MultifrontalLu {
 public:
  MultifrontalLu() = default;
  /// `sizes`: rows, and columns, of each diagonal block. `couplings`: pairs (row, column) of the blocks of A that may
  /// differ from 0, any number of times.
  MultifrontalLu(const std::vector<int>& sizes, const std::vector<std::pair<int, int>>& couplings);

  /// Where a block of A is written: column by column, `stride` from column to column, from values() + begin.
  struct Place {
    std::size_t begin = 0;
    int stride = 0;
  };
  /// Of block (row, column), one that may differ from 0.
  Place PlaceOf(int row, int column) const;
  double* values() { return values_.data(); }

  /// Clears all that is not in a block that may differ from 0. Every such block is written, before or after this,
  /// before Factor().
  void ClearFill();
  /// Overwrites A. False where a pivot vanishes: where A is singular, or the Schur complement that a front eliminates.
  bool Factor();
  /// x <- A⁻¹ x
  void Solve(double* x) const;
  /// x <- A⁻¹ x for `columns` right sides, x [rows x columns] row by row without gaps.
  void SolveRows(int columns, double* x) const;
  /// x <- A⁻ᵀ x
  void SolveTransposed(double* x) const;

 private:
  struct Front {
    int size = 0, own = 0;  // rows of the front; the first `own` of them are eliminated
    std::size_t begin = 0;  // of its matrix [size x size] in values_
    int first_row = 0;      // of its rows in rows_
    int first_pivot = 0;    // of its pivots in pivots_
    int parent = -1;        // the front to which its Schur complement is added
    int first_run = 0, last_run = 0;
  };
  // Rows of a front below its own that are consecutive in the parent, too.
  struct Run {
    int from = 0, to = 0, count = 0;
  };

  template <class Some, int kCount>
  void SolveStrip(std::ptrdiff_t stride, double* x) const;
  void AddToParent(const Front& front);
  void FindFill(const std::vector<int>& sizes, const std::vector<std::pair<int, int>>& couplings);

  std::vector<Front> fronts_;  // in the order of elimination
  std::vector<Run> runs_;
  std::vector<std::pair<std::size_t, int>>
      fill_;               // first and number of consecutive values outside of A's blocks
  std::vector<int> rows_;  // per row of a front: row of A
  std::vector<int> pivots_;
  std::vector<double> values_;
  mutable std::vector<double> scratch_;
  // Per block: its front, and per front its blocks and where they begin.
  std::vector<int> front_of_;
  std::vector<std::vector<std::pair<int, int>>> blocks_;
};

}  // namespace fork1s
