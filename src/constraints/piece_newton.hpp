// Newton's method on the pieces of Coulomb's law (pieces.cpp), d and λ side by side.
#pragma once

#include <vector>

#include "compliant_rows.hpp"
#include "derivative_lu.hpp"
#include "few_rows.hpp"

namespace fork1s::internal {

class PieceNewton {
 public:
  void Reserve(int freedoms);
  /// From d and the impulses at hand, d = Σ Gᵀλ. True: both are those of the answer. Else neither is.
  bool Solve(CompliantRows& rows, std::vector<double>& d, double tolerance, int& iterations);
  /// On the pieces that d is on, to where d = Σ Gᵀλ holds to rounding. Whether that is the answer.
  bool Settle(CompliantRows& rows, std::vector<double>& d, double tolerance);
  /// Without an answer: d <- Σ Gᵀλ of the impulses at hand, which stay.
  void AcceptImpulses(CompliantRows& rows, std::vector<double>& d);
  /// |λ − Π(y)| / |Σ Gᵀλ|, both weighed by inertia.
  double Residual(const CompliantRows& rows) const {
    return rows.law_gap() == 0 ? 0 : rows.law_gap() / push_norm_;
  }

 private:
  bool SettleFew(CompliantRows& rows, std::vector<double>& d);
  void Refine(CompliantRows& rows, std::vector<double>& d);
  double Off(CompliantRows& rows, const std::vector<double>& d);
  void Step(CompliantRows& rows, std::vector<double>& d);
  bool Reached(const CompliantRows& rows, double tolerance) const {
    return rows.law_gap() <= tolerance * push_norm_ + rows.law_noise();
  }

  std::vector<double> step_, push_;  // push_: Σ Gᵀλ
  DerivativeLu lu_;
  FewRows few_;
  double push_norm_ = 0;
};

}  // namespace fork1s::internal
