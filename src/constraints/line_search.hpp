// Line search along a Newton step to the root of its slope.
#pragma once

#include <cmath>

namespace fork1s::internal {

/// Share of the slope at the start below which a length is accepted.
constexpr double kSlopeReduction = 0.1;
constexpr int kMaxSlopeEvaluations = 30;

/// A length in (0, 1] at which |slope| <= kSlopeReduction |start|, by regula falsi with the Illinois modification from
/// the bracket [0, 1]; 1 where the slope there is not above that, or `start` is not below 0. `evaluate(length)` moves to
/// the length and returns the slope; it was called last for the length returned, unless that is 1.
template <class Evaluate>
double FindSlopeRoot(double start, double slope_at_one, const Evaluate& evaluate) {
  const double enough = kSlopeReduction * std::abs(start);
  double length = 1, slope = slope_at_one;
  if (!(start < 0 && slope > enough)) return length;
  double low = 0, f_low = start, high = 1, f_high = slope;
  int side = 0;
  for (int k = 0; k < kMaxSlopeEvaluations && std::abs(slope) > enough; ++k) {
    length = low + (high - low) * f_low / (f_low - f_high);
    if (!(length > low && length < high)) length = 0.5 * (low + high);
    slope = evaluate(length);
    if (slope > 0) {
      high = length;
      f_high = slope;
      if (side == 1) f_low *= 0.5;
      side = 1;
    } else {
      low = length;
      f_low = slope;
      if (side == -1) f_high *= 0.5;
      side = -1;
    }
  }
  return length;
}

}  // namespace fork1s::internal
