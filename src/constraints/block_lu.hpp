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
    int f = 0, rows = 0;    // of the block, and with its hub
    std::size_t at = 0;     // in values_: the panel, C', inverse pivots
    std::size_t swaps = 0;  // in swaps_
  };
  struct Panel {
    double* values;   // rows x f: L and U, and D' below
    double* C;        // f x hub
    double* inverse;  // of pivots
    int f, rows;

    double* column(int k) const { return values + static_cast<std::ptrdiff_t>(k) * rows; }
  };
  Panel PanelOf(const Part& part);
  template <class Size>
  static bool FactorPanel(const Panel& panel, Size f, int* swaps);
  template <class Size>
  static void Forward(const Panel& panel, Size f, double* a);
  template <class Size>
  static void Backward(const Panel& panel, Size f, double* a);
  bool Eliminate(const EliminationOrder& order, std::size_t block, double* H, int n);

  std::vector<Part> parts_;
  std::vector<int> pivots_, swaps_;
  std::size_t core_at_ = 0;
  std::vector<double> values_, x_core_;
};

}  // namespace fork1s::internal
