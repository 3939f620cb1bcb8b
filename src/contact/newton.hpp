// Semismooth Newton on the assembled contact problem, for where sweeps are too slow.
#pragma once

#include <vector>

#include "contact_rows.hpp"

namespace fork1s::internal {

class NewtonSolver {
 public:
  /// Reserves scratch for `num_rows` = 3 contacts + limits.
  void Reserve(int num_rows);
  /// Improves the impulses in `rows` until the residual is `enough`, and then as far as quick steps carry.
  /// Leaves the best impulses it met (never worse than the start) and the velocity that belongs to them.
  /// Returns the number of iterations.
  int Solve(RowSet& rows, double enough, int max_iterations);

  /// The problem that the last Solve assembled: u = A λ + b, rows 3 a contact, then 1 a limit.
  const std::vector<double>& A() const { return A_data_; }
  const std::vector<double>& b() const { return b_; }

 private:
  void Assemble(const RowSet& rows);
  void ReadImpulses(const RowSet& rows);
  void WriteImpulses(const std::vector<double>& from, RowSet& rows) const;
  double Evaluate(const RowSet& rows, const std::vector<double>& x);
  bool ComputeStep(const RowSet& rows);

  int n_ = 0;
  double regularisation_ = 0;
  std::vector<double> A_data_, G_data_;  // n x n: J W Jᵀ; Newton matrix
  std::vector<int> pivots_;
  std::vector<double> b_, x_, trial_, best_, u_, F_, step_;
};

}  // namespace fork1s::internal
