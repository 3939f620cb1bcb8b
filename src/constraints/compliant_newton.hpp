// Newton's method on F(d) = 0, and what helps it where it stalls: for problems that pieces do not solve.
#pragma once

#include <vector>

#include "compliant_rows.hpp"
#include "derivative_lu.hpp"
#include "friction_path.hpp"
#include "piece_newton.hpp"

namespace fork1s::internal {

class CompliantNewton {
 public:
  void Reserve(int num_contacts, int num_limits, int freedoms);
  /// What `pieces` did not solve. `change`, in freedoms: in Σ Gᵀλ of a guess, out that of the impulses found,
  /// which are in `rows`. Of the report: converged, stage, newton_iterations.
  void Solve(CompliantRows& rows, PieceNewton& pieces, const ContactSolverOptions& options,
             std::vector<double>& change, ContactSolverReport& report);

 private:
  bool Run(CompliantRows& rows, double tolerance, int max_iterations, int patience, int& iterations);
  bool ByPath(CompliantRows& rows, double tolerance, int& iterations);
  bool Frozen(CompliantRows& rows, int rounds, double tolerance, int& iterations);
  bool Settle(CompliantRows& rows, PieceNewton& pieces, double tolerance, int& iterations);
  void Leave(CompliantRows& rows, double tolerance, int& iterations);

  std::vector<double> d_, trial_, step_, kept_;
  FrictionPath path_;
  DerivativeLu lu_;
};

}  // namespace fork1s::internal
