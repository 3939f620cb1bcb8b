// The derivative of a contact problem, factored by what touches what.
#pragma once

#include <vector>

namespace fork1s::internal {

/// A block that touches one other at most: a finger on what it holds, a ball on a pile.
struct Leaf {
  int begin = 0, count = 0;          // its freedoms
  int hub_begin = 0, hub_count = 0;  // those of what it touches; none: only the world
};

/// H = L U where leaves are eliminated first, each on its own hub, and the rest is dense. With five fingers
/// of four freedoms on one body that is a tenth of what all at once takes.
class LeafLu {
 public:
  void Reserve(int freedoms);
  /// H n x n, overwritten. Freedoms that are no leaf's stand in `core`, hubs among them. False where a pivot
  /// vanishes: rows are interchanged within a leaf and within the core, not across.
  bool Factor(const std::vector<Leaf>& leaves, const std::vector<int>& core, double* H, int n);
  /// x <- H⁻¹ x, by the leaves and core of the last factor.
  void Solve(double* x);

 private:
  struct Part {
    Leaf leaf;
    int stride = 0;
    std::size_t at = 0;  // in values_: rows [1 A⁻¹C A⁻¹] of `stride`, then D by columns
  };
  std::vector<Part> parts_;
  std::vector<int> core_, pivots_;
  std::size_t core_at_ = 0;
  std::vector<double> values_, x_leaf_, x_core_;
};

}  // namespace fork1s::internal
