#include "derivative_lu.hpp"
#include "linalg/in_place.hpp"

namespace fork1s::internal {

void DerivativeLu::Reserve(int freedoms) {
  const auto n = static_cast<std::size_t>(freedoms);
  H_.reserve(n * n);
  pivots_.reserve(n);
  block_lu_.Reserve(freedoms);
}

bool DerivativeLu::Factor(RegularizedContactProblem& rows) {
  const auto n = static_cast<std::size_t>(rows.freedoms());
  H_.resize(n * n);
  rows.DerivativeByBlocks(H_.data());
  by_blocks_ = block_lu_.Factor(rows.order(), H_.data(), rows.freedoms());
  if (by_blocks_) return true;
  // A block may have no answer by itself where it slides; what it touches can give it one.
  rows.Derivative(H_.data());
  pivots_.resize(n);
  return FactorLu(H_.data(), rows.freedoms(), pivots_.data());
}

void DerivativeLu::Solve(const RegularizedContactProblem& rows, double* x) {
  if (by_blocks_)
    block_lu_.Solve(rows.order(), x);
  else
    SolveWithLu(H_.data(), rows.freedoms(), pivots_.data(), x);
}

void DerivativeLu::SolveFour(const RegularizedContactProblem& rows, double* x) {
  if (by_blocks_)
    block_lu_.SolveFour(rows.order(), x);
  else
    SolveRowsWithLu(H_.data(), rows.freedoms(), pivots_.data(), 4, x);
}

}  // namespace fork1s::internal
