// The derivative of a contact problem, factored by what meets what.
#pragma once

#include <cstddef>
#include <vector>

#include "elimination_order.hpp"

namespace fork1s::internal {

/// H = L U where blocks are eliminated in order, each on what it meets then, and the rest is dense. With five
/// fingers of four freedoms on one body that is a tenth of what all at once takes.
class BlockLu {
 public:
  void Reserve(int freedoms);
  /// H n x n, by columns, overwritten. False where a pivot vanishes: rows are interchanged within a block and
  /// within the core, not across.
  bool Factor(const EliminationOrder& order, double* H, int n);
  /// x <- H⁻¹ x, by the last factor. `order` is that of the factor.
  void Solve(const EliminationOrder& order, double* x);
  /// The same for four right sides, x n x 4 row by row: in hardly more time than one.
  void SolveFour(const EliminationOrder& order, double* x);

 private:
  struct Part {
    int width = 0, stride = 0;
    std::size_t at = 0;     // in values_: rows [U A⁻¹C] of `stride`, L, inverse pivots, D by columns
    std::size_t swaps = 0;  // in swaps_
  };
  bool Eliminate(const EliminationOrder& order, std::size_t block, double* H, int n);

  std::vector<Part> parts_;
  std::vector<int> pivots_, swaps_;
  std::size_t core_at_ = 0;
  std::vector<double> values_, x_hub_, x_core_;
};

}  // namespace fork1s::internal
