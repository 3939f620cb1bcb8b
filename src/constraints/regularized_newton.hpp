// Newton's method on F(d) = 0, and what helps it where it stalls: for problems that modes do not solve.
#pragma once

#include <vector>

#include "derivative_lu.hpp"
#include "friction_continuation.hpp"
#include "regularized_contact_problem.hpp"
#include "semismooth_newton.hpp"

namespace fork1s::internal {

class RegularizedNewton {
 public:
  void Reserve(int num_contacts, int num_limits, int freedoms);
  /// What `modes` did not solve. `change`, in freedoms: in Σ Gᵀλ of a guess, out that of the impulses found,
  /// which are in `rows`. Of the report: converged, stage, newton_iterations.
  void Solve(RegularizedContactProblem& rows, SemismoothNewton& semismooth,
             const ContactSolverOptions& options, std::vector<double>& change, ContactSolverReport& report);

 private:
  bool Run(RegularizedContactProblem& rows, double tolerance, int max_iterations, int patience,
           int& iterations);
  bool SolveByContinuation(RegularizedContactProblem& rows, double tolerance, int& iterations);
  bool SolveByDilatancy(RegularizedContactProblem& rows, double tolerance, int& iterations);
  bool SolveByTresca(RegularizedContactProblem& rows, int rounds, double tolerance, int& iterations);
  bool RefineBySemismooth(RegularizedContactProblem& rows, SemismoothNewton& semismooth, double tolerance,
                          int& iterations);
  void SolveConvexFallback(RegularizedContactProblem& rows, double tolerance, int& iterations);

  std::vector<double> d_, trial_, step_, kept_, last_level_;
  FrictionContinuation path_;
  DerivativeLu lu_;
};

}  // namespace fork1s::internal
