// Which share of a step's forces acts at its end: the modal theta rule (docs/method.md, section 5).
//
// Slow modes take the trapezoid, which keeps their energy; modes that a step cannot follow take implicit
// Euler, which brings them to rest; in between the share rises with y = h ω:
//     θ = ½ + ½ y⁴/(c⁴ + y⁴),  c = 1.2;   Th = V diag(θ) VᵀM,  (ω², V) = eig(K, M) at the reference
//     w⁺ = u + h M⁻¹ f(z + h Th w̄),   w̄ = w + Th (w⁺ + u - 2 w),   z⁺ = z + h w̄
// with w the rate at the start and u the same as the pose half way sees it.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>
#include <vector>

namespace fork1s {

struct VelocityRange {
  int begin = 0, size = 0;
};

/// Operators of the rule for one step length, all r x r. Euler: Th = 1.
struct ThetaScheme {
  double h = -1;  // s; -1: nothing computed
  MatrixX Th;
  // What acts on w⁺ and on w: h D_end + h² K Th², and h (D - D_end) + h² K Th (1 - Th), with D_end the damping that acts
  // at the end.
  MatrixX end, start;
  bool symmetric = true;  // end

  /// `ranges`: coordinates that nothing couples to others, each with modes of its own. `must_be_symmetric`: `end` has to
  /// be, as rows of dry friction ask.
  void Fill(const ReducedModel& model, const std::vector<VelocityRange>& ranges, double step, bool euler,
            bool must_be_symmetric);
};

}  // namespace fork1s
