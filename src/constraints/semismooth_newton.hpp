// Newton's method on the modes of Coulomb's law (contact_modes.cpp), d and λ side by side.
#pragma once

#include <vector>

#include "derivative_lu.hpp"
#include "low_rank_mode_update.hpp"
#include "regularized_contact_problem.hpp"

namespace fork1s::internal {

class SemismoothNewton {
 public:
  void Reserve(int freedoms);
  /// From d and the impulses at hand, d = Σ Gᵀλ. True: both are those of the answer. Else neither is.
  bool Solve(RegularizedContactProblem& rows, std::vector<double>& d, double tolerance, int& iterations);
  /// On the modes that d is on, to where d = Σ Gᵀλ holds to rounding. Whether that is the answer.
  bool RefineInFixedModes(RegularizedContactProblem& rows, std::vector<double>& d, double tolerance);
  /// Without an answer: d <- Σ Gᵀλ of the impulses at hand, which stay.
  void AcceptImpulses(RegularizedContactProblem& rows, std::vector<double>& d);
  /// |λ − Π(y)| / |Σ Gᵀλ|, both weighed by inertia.
  double Residual(const RegularizedContactProblem& rows) const {
    return rows.law_gap() == 0 ? 0 : rows.law_gap() / push_norm_;
  }

 private:
  bool SolveModeChanges(RegularizedContactProblem& rows, std::vector<double>& d);
  void Refine(RegularizedContactProblem& rows, std::vector<double>& d);
  double Off(RegularizedContactProblem& rows, const std::vector<double>& d);
  void Step(RegularizedContactProblem& rows, std::vector<double>& d);
  bool Reached(const RegularizedContactProblem& rows, double tolerance) const {
    return rows.law_gap() <= tolerance * push_norm_ + rows.law_noise();
  }

  std::vector<double> step_, push_;  // push_: Σ Gᵀλ
  DerivativeLu lu_;
  LowRankModeUpdate mode_update_;
  double push_norm_ = 0;
};

}  // namespace fork1s::internal
