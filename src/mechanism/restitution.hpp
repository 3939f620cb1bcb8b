// Restitution and damping ratio: two names of one property of a contact.
#pragma once

#include <cmath>
#include <numbers>

namespace fork1s {

/// Share of its speed that an oscillator of damping ratio ζ has left after half a swing, which is how long a
/// contact lasts: exp(−π ζ/√(1 − ζ²)), and 0 from ζ = 1 on. (Nagurka and Huang, A mass-spring-damper model of
/// a bouncing ball, 2004, without gravity.)
inline double RestitutionOf(double damping_ratio) {
  if (!(damping_ratio < 1)) return 0;
  if (damping_ratio <= 0) return 1;
  return std::exp(-std::numbers::pi * damping_ratio / std::sqrt(1 - damping_ratio * damping_ratio));
}

/// The damping ratio that leaves a share `restitution` in [0, 1]; 1 for none.
inline double DampingRatioOf(double restitution) {
  if (!(restitution > 0)) return 1;
  const double l = std::log(restitution) / std::numbers::pi;
  return std::sqrt(l * l / (1 + l * l));
}

}  // namespace fork1s
