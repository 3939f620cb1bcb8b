// ∂F/∂d of the modes at hand, factored.
#pragma once

#include <vector>

#include "block_lu.hpp"
#include "regularized_contact_problem.hpp"

namespace fork1s::internal {

class DerivativeLu {
 public:
  void Reserve(int freedoms);
  /// False where it is singular.
  bool Factor(RegularizedContactProblem& rows);
  /// x <- (∂F/∂d)⁻¹ x of the last factor; `rows` are those that it was of.
  void Solve(const RegularizedContactProblem& rows, double* x);
  /// The same for four right sides, x freedoms x 4 row by row.
  void SolveFour(const RegularizedContactProblem& rows, double* x);

 private:
  std::vector<double> H_;
  std::vector<int> pivots_;
  BlockLu block_lu_;
  bool by_blocks_ = false;  // the factor at hand
};

}  // namespace fork1s::internal
