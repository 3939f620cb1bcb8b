// Newton's method on F(d) = 0, and what helps it where it stalls.
#pragma once

#include <vector>

#include "compliant_rows.hpp"
#include "derivative_lu.hpp"
#include "friction_path.hpp"
#include "piece_newton.hpp"

namespace fork1s::internal {

struct NewtonOutcome {
  int iterations = 0;
  int stage = 0;  // of ContactSolverReport
  bool converged = false;
  double residual = 0;  // PieceNewton's
};

class CompliantNewton {
 public:
  void Reserve(int num_contacts, int num_limits, int freedoms);
  /// From the impulses in `rows`. Leaves impulses of the answer there.
  NewtonOutcome Solve(CompliantRows& rows, double tolerance, int max_iterations);
  /// Σ Gᵀλ of the answer.
  const std::vector<double>& change() const { return d_; }

 private:
  bool Run(CompliantRows& rows, double tolerance, int max_iterations, int patience, int& iterations);
  bool ByPath(CompliantRows& rows, double tolerance, int& iterations);
  bool Frozen(CompliantRows& rows, int rounds, double tolerance, int& iterations);
  bool Settle(CompliantRows& rows, double tolerance, int& iterations);
  void Leave(CompliantRows& rows, double tolerance, int& iterations);

  std::vector<double> d_, trial_, step_, kept_;
  PieceNewton pieces_;
  FrictionPath path_;
  DerivativeLu lu_;
};

}  // namespace fork1s::internal
