// Answers of the law with a share σ of its friction, F(d, σ) = 0, form paths. At σ = 0 the problem is convex
// and has one answer, from which one path starts; impulses never do work on what they are given, so d stays
// bounded for all σ, and the path can only end at σ = 1. It may turn back on the way, where answers come in
// threes: so it is followed by its length, not by σ (Allgower and Georg, Introduction to Numerical
// Continuation Methods). Pieces of the law (contact_modes.cpp) make it a chain of smooth arcs. On each
//     H ḋ = σ̇ Σ Gᵀ ∂λ/∂σ,   σ̇ of the sign of det H
// is the way on, since the sign of det H changes where the path turns back and nowhere else.
#include "friction_continuation.hpp"
#include "linalg/in_place.hpp"

#include <algorithm>
#include <cmath>

namespace fork1s::internal {
namespace {

constexpr int kCorrections = 8, kCorners = 6;
constexpr double kOnPath = 1e-5;                // |F| / |Σ Gᵀλ| of places on the way
constexpr double kFirst = 0.1, kLongest = 0.5;  // of the path's length, which is 1 where nothing changes
constexpr double kCorner = 1e-7;                // shorter than any arc that need be seen
constexpr double kAroundCorner = 1e-3;

}  // namespace

void FrictionContinuation::Reserve(int num_contacts, int num_limits, int freedoms) {
  const auto n = static_cast<std::size_t>(freedoms);
  H_.reserve(n * n);
  pivots_.reserve(n);
  newton_.Reserve(freedoms);
  for (std::vector<double>* v :
       {&a_, &b_, &here_.d, &predicted_.d, &trial_.d, &last_.d, &along_.d, &ahead_.d, &next_.d})
    v->reserve(n);
  for (std::vector<PointRows>* v : {&points_, &ahead_points_, &last_points_})
    v->reserve(static_cast<std::size_t>(num_contacts));
  for (std::vector<LimitRows>* v : {&limits_, &ahead_limits_, &last_limits_})
    v->reserve(static_cast<std::size_t>(num_limits));
}

// Factors H of the modes at a place; a and b: where they lead, and that by share.
bool FrictionContinuation::Linearize(RegularizedContactProblem& rows, const Place& at) {
  const int n = rows.freedoms();
  rows.SetFrictionShare(at.share);
  rows.UpdateModes(at.d.data());
  rows.Derivative(H_.data());
  a_ = rows.right_side();
  rows.PushByShare(b_.data());
  if (!FactorLu(H_.data(), n, pivots_.data())) return false;
  SolveWithLu(H_.data(), n, pivots_.data(), a_.data());
  SolveWithLu(H_.data(), n, pivots_.data(), b_.data());
  return true;
}

void FrictionContinuation::DirectionHere(Direction& out) const {
  const std::size_t n = b_.size();
  bool negative = false;
  for (std::size_t k = 0; k < n; ++k)
    negative ^= (H_[k * (n + 1)] < 0) != (pivots_[k] != static_cast<int>(k));
  out.share = (negative ? -1 : 1) / std::sqrt(1 + Dot(b_, b_) / scale2_);
  out.d = b_;
  for (double& x : out.d) x *= out.share;
}

// Newton's method back to the path, across the way. `ahead`: the way on by the modes where it began.
bool FrictionContinuation::Correct(RegularizedContactProblem& rows, const Direction& along, double length,
                                   Place& place, int& iterations, Direction& ahead) {
  predicted_ = place;
  for (int k = 0; k < kCorrections; ++k) {
    ++iterations;
    if (!Linearize(rows, place)) return false;
    if (k == 0) {
      DirectionHere(ahead);
      ahead_points_ = rows.points;
      ahead_limits_ = rows.limits;
    }
    double off = along.share * (place.share - predicted_.share), rate = along.share;
    for (std::size_t i = 0; i < a_.size(); ++i) {
      off += along.d[i] * (a_[i] - predicted_.d[i]) / scale2_;
      rate += along.d[i] * b_[i] / scale2_;
    }
    const double more = -off / rate;
    for (std::size_t i = 0; i < a_.size(); ++i) place.d[i] = a_[i] + more * b_[i];
    place.share += more;
    if (!std::isfinite(place.share) || std::abs(place.share - predicted_.share) > 1) return false;
    rows.SetFrictionShare(place.share);
    rows.Evaluate(place.d.data(), false);
    const bool reached = rows.Reached(kOnPath);
    rows.ComputeLinearizedImpulses(place.d.data(), more);
    if (!reached) continue;
    double moved2 = (place.share - predicted_.share) * (place.share - predicted_.share);
    for (std::size_t i = 0; i < a_.size(); ++i)
      moved2 += (place.d[i] - predicted_.d[i]) * (place.d[i] - predicted_.d[i]) / scale2_;
    return moved2 < length * length;  // else it has leapt to another path
  }
  return false;
}

bool FrictionContinuation::Arrive(RegularizedContactProblem& rows, Place& place, double tolerance,
                                  int& iterations) {
  last_points_ = rows.points;
  last_limits_ = rows.limits;
  rows.SetFrictionShare(1);
  last_ = place;
  if (newton_.Solve(rows, last_.d, tolerance, iterations)) {
    place = last_;
    return true;
  }
  rows.points = last_points_;
  rows.limits = last_limits_;
  return false;
}

// From `here_` on to `trial_`, by `length` or less. `there`: that is the answer with all of the friction.
bool FrictionContinuation::Advance(RegularizedContactProblem& rows, double& length, double tolerance,
                                   int& iterations, bool& there) {
  points_ = rows.points;
  limits_ = rows.limits;
  for (int corners = 0; corners <= kCorners;) {
    trial_ = here_;
    for (std::size_t i = 0; i < trial_.d.size(); ++i) trial_.d[i] += length * along_.d[i];
    trial_.share += length * along_.share;
    rows.points = points_;
    rows.limits = limits_;
    rows.ComputeLinearizedImpulses(trial_.d.data(), length * along_.share);
    bool found = Correct(rows, along_, length, trial_, iterations, ahead_);
    if (found && length > 4 * kCorner) {
      // Arcs that come together in a cusp lie side by side: what points back after a step that can be shorter
      // may be the one that it came from.
      if (!Linearize(rows, trial_)) return false;
      DirectionHere(next_);
      found = next_.share * along_.share + Dot(next_.d, along_.d) / scale2_ > 0;
    }
    // Past all of the friction the answer is nearer.
    if (found && (trial_.share <= 1 || (there = Arrive(rows, trial_, tolerance, iterations)))) return true;
    length *= 0.25;
    if (length > kCorner) continue;
    // Where the path turns by more than a right angle, the next arc does not come by the plane across this
    // one: on along that arc.
    ++corners;
    std::swap(along_, ahead_);
    points_.swap(ahead_points_);
    limits_.swap(ahead_limits_);
    length = kAroundCorner;
  }
  return false;
}

bool FrictionContinuation::Follow(RegularizedContactProblem& rows, std::vector<double>& d, double tolerance,
                                  int most_iterations, int& iterations) {
  const std::size_t n = d.size();
  for (std::vector<double>* v : {&a_, &b_}) v->assign(n, 0.0);
  H_.resize(n * n);
  pivots_.resize(n);
  here_.d = d;
  here_.share = 0;
  scale2_ = std::max(Dot(d, d), 1e-300);
  double length = kFirst;
  bool there = false;
  while (iterations < most_iterations && !there) {
    if (!Linearize(rows, here_)) break;
    DirectionHere(along_);
    there = here_.share + length * along_.share >= 1 && Arrive(rows, here_, tolerance, iterations);
    if (there) break;
    if (!Advance(rows, length, tolerance, iterations, there)) break;
    std::swap(here_, trial_);
    length = std::min(2 * length, kLongest);
  }
  rows.SetFrictionShare(1);
  if (there) d = here_.d;
  return there;
}

}  // namespace fork1s::internal
