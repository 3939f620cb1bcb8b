// ∂F/∂d of the pieces at hand, factored.
#pragma once

#include <vector>

#include "block_lu.hpp"
#include "compliant_rows.hpp"

namespace fork1s::internal {

class DerivativeLu {
 public:
  void Reserve(int freedoms);
  /// False where it is singular.
  bool Factor(CompliantRows& rows);
  /// x <- (∂F/∂d)⁻¹ x of the last factor; `rows` are those that it was of.
  void Solve(const CompliantRows& rows, double* x);
  /// The same for four right sides, x freedoms x 4 row by row.
  void SolveFour(const CompliantRows& rows, double* x);

 private:
  std::vector<double> H_;
  std::vector<int> pivots_;
  BlockLu block_lu_;
  bool by_blocks_ = false;  // the factor at hand
};

}  // namespace fork1s::internal
