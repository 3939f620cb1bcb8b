#include "semismooth_newton.hpp"

#include <cmath>
#include <limits>

namespace fork1s::internal {
namespace {

// |d − Σ Gᵀλ| / |Σ Gᵀλ| that needs no more of it: rounding, where impulses a thousand times as large cancel.
constexpr double kRefined = 1e-13;
// |λ − Π(y)| / |Σ Gᵀλ| that a step or two more usually reach, since they converge by squares. Two rows both
// at the end of what they bear may take turns a little above it.
constexpr double kAim = 1e-12;
constexpr int kMaxIterations = 16;

}  // namespace

void SemismoothNewton::Reserve(int freedoms) {
  for (std::vector<double>* v : {&step_, &push_}) v->reserve(static_cast<std::size_t>(freedoms));
  lu_.Reserve(freedoms);
  mode_update_.Reserve(freedoms);
}

// Impulses λ = −D w carry the rounding of w, (inverse mass)/R times as large as it should be: 1e11 times for
// rows that give nothing. On their modes they need not be computed from w again: s = −H⁻¹F, d += s,
// λ −= D G s.
void SemismoothNewton::Refine(RegularizedContactProblem& rows, std::vector<double>& d) {
  for (double before = 1e300;;) {
    const double off = Off(rows, d);
    if (off <= kRefined * push_norm_ || !(off < 0.5 * before)) break;
    before = off;
    Step(rows, d);
  }
  d = push_;
}

// |d − Σ Gᵀλ|
double SemismoothNewton::Off(RegularizedContactProblem& rows, const std::vector<double>& d) {
  push_.resize(d.size());
  rows.Push(push_.data());
  double push2 = 0, off2 = 0;
  for (std::size_t i = 0; i < d.size(); ++i) {
    push2 += push_[i] * push_[i];
    off2 += (push_[i] - d[i]) * (push_[i] - d[i]);
  }
  push_norm_ = std::sqrt(push2);
  return std::sqrt(off2);
}

void SemismoothNewton::Step(RegularizedContactProblem& rows, std::vector<double>& d) {
  step_.resize(d.size());
  for (std::size_t i = 0; i < d.size(); ++i) step_[i] = push_[i] - d[i];
  lu_.Solve(rows, step_.data());
  for (std::size_t i = 0; i < d.size(); ++i) d[i] += step_[i];
  rows.MoveInFixedModes(step_.data());
}

// Where the law fails at a few points only they are solved by themselves, on the factor at hand. What opens
// sheds what its mode says there, a thousand times what it bears, and leaves the rounding of it in d − Σ
// Gᵀλ: then once more from there, where next to nothing is left to shed.
bool SemismoothNewton::SolveModeChanges(RegularizedContactProblem& rows, std::vector<double>& d) {
  mode_update_.Begin();
  while (mode_update_.Gather(rows, kAim * push_norm_ + rows.law_noise())) {
    for (int round = 0; round < 2; ++round) {
      if (!mode_update_.Solve(rows, lu_, d, kAim * push_norm_ + rows.law_noise())) return false;
      if (Off(rows, d) <= kRefined * push_norm_ || round > 0) break;
      Step(rows, d);
      rows.MeasureLaw(d.data());
    }
    d = push_;
    rows.MeasureLaw(d.data());
    if (Reached(rows, kAim)) return true;
  }
  return false;
}

bool SemismoothNewton::Solve(RegularizedContactProblem& rows, std::vector<double>& d, double tolerance,
                             int& iterations) {
  rows.UpdateModes(d.data(), true);
  double before = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    ++iterations;
    if (!lu_.Factor(rows)) return false;
    d = rows.right_side();
    lu_.Solve(rows, d.data());
    rows.ComputeLinearizedImpulses(d.data());
    Refine(rows, d);
    rows.MeasureLaw(d.data());
    if (Reached(rows, kAim) || (Reached(rows, tolerance) && !(rows.law_gap() < 0.5 * before))) return true;
    if (SolveModeChanges(rows, d)) return true;
    before = rows.law_gap();
    rows.UpdateModes(d.data());
  }
  return Reached(rows, tolerance);
}

bool SemismoothNewton::RefineInFixedModes(RegularizedContactProblem& rows, std::vector<double>& d,
                                          double tolerance) {
  rows.Evaluate(d.data(), true);
  if (!lu_.Factor(rows)) return false;
  Refine(rows, d);
  rows.UpdateModes(d.data());
  return Reached(rows, tolerance);
}

void SemismoothNewton::AcceptImpulses(RegularizedContactProblem& rows, std::vector<double>& d) {
  rows.Push(d.data());
  push_norm_ = std::sqrt(Dot(d, d));
  rows.UpdateModes(d.data());
}

}  // namespace fork1s::internal
