#include "piece_newton.hpp"

#include <cmath>
#include <limits>

namespace fork1s::internal {
namespace {

// |d − Σ Gᵀλ| / |Σ Gᵀλ| that needs no more of it: rounding, where impulses a thousand times as large cancel.
constexpr double kRefined = 1e-13;
// |λ − Π(y)| / |Σ Gᵀλ| that a step or two more usually reach, since they converge by squares. Two rows both at
// the end of what they bear may take turns a little above it.
constexpr double kAim = 1e-12;

}  // namespace

void PieceNewton::Reserve(int freedoms) {
  step_.reserve(static_cast<std::size_t>(freedoms));
  lu_.Reserve(freedoms);
}

// Impulses λ = −D w carry the rounding of w, (inverse mass)/R times as large as it should be: 1e11 times for
// rows that give nothing. On their pieces they need not be computed from w again: s = −H⁻¹F, d += s,
// λ −= D G s.
void PieceNewton::Refine(CompliantRows& rows, std::vector<double>& d) {
  step_.resize(d.size());
  for (double before = 1e300;;) {
    rows.Push(step_.data());
    double push2 = 0, F2 = 0;
    for (std::size_t i = 0; i < d.size(); ++i) {
      push2 += step_[i] * step_[i];
      F2 += (step_[i] - d[i]) * (step_[i] - d[i]);
    }
    push_norm_ = std::sqrt(push2);
    if (F2 <= kRefined * kRefined * push2 || !(F2 < 0.25 * before)) break;
    before = F2;
    for (std::size_t i = 0; i < d.size(); ++i) step_[i] -= d[i];
    lu_.Solve(rows, step_.data());
    for (std::size_t i = 0; i < d.size(); ++i) d[i] += step_[i];
    rows.MoveOnPieces(step_.data());
  }
  d = step_;
}

bool PieceNewton::Solve(CompliantRows& rows, std::vector<double>& d, double tolerance, int max_iterations,
                        int& iterations) {
  rows.TakePieces(d.data(), true);
  double before = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    ++iterations;
    if (!lu_.Factor(rows)) return false;
    d = rows.right_side();
    lu_.Solve(rows, d.data());
    rows.ImpulsesOfPieces(d.data());
    Refine(rows, d);
    rows.TakePieces(d.data());
    if (Reached(rows, kAim) || (Reached(rows, tolerance) && !(rows.law_gap() < 0.5 * before))) return true;
    before = rows.law_gap();
  }
  return Reached(rows, tolerance);
}

bool PieceNewton::Settle(CompliantRows& rows, std::vector<double>& d, double tolerance) {
  rows.Evaluate(d.data(), true);
  if (!lu_.Factor(rows)) return false;
  Refine(rows, d);
  rows.TakePieces(d.data());
  return Reached(rows, tolerance);
}

void PieceNewton::LeaveAt(CompliantRows& rows, std::vector<double>& d) {
  rows.Push(d.data());
  push_norm_ = std::sqrt(Dot(d, d));
  rows.TakePieces(d.data());
}

}  // namespace fork1s::internal
