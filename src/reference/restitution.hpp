// Restitution of a contact that closes within a step.
//
// Relative normal motion: speed of approach v before the step, acceleration a > 0 of approach without
// contact. After the contact opens again with the share e of the speed of touch u_c, the speed u at the end
// of the step at the height gap + h u satisfies the energy balance
//     u²/2 + a (gap + h u) = e² u_c²/2,   u_c² = v² + 2 a gap,
// a quadratic u² + 2 (a h) u - p = 0 with p = e² u_c² - 2 a gap and the positive root p/(a h + √((a h)² + p)).
#pragma once

#include <cmath>

namespace fork1s::reference {

/// u [m/s], or 0 for a contact that does not open within the step. `free_speed`: normal speed at the end of
/// the step without contact. No u exists if the rebound would end below the gap, or (resting contact) if
/// the acceleration alone produces the approach within one step.
inline double ComputeReboundSpeed(double restitution, double approach, double free_speed, double gap,
                                  double h) {
  const bool closes = gap + h * free_speed < 0;
  if (restitution <= 0 || approach <= 0 || !closes) return 0;
  const double speed_gain = -free_speed - approach;  // a h
  if (approach <= speed_gain) return 0;
  const double twice_a_gap = 2 * speed_gain * gap / h;
  const double touch_squared = approach * approach + twice_a_gap;
  const double p = (touch_squared > 0 ? restitution * restitution * touch_squared : 0) - twice_a_gap;
  if (!(p > 0)) return 0;
  const double root = std::sqrt(speed_gain * speed_gain + p);
  return speed_gain > 0 ? p / (speed_gain + root) : root - speed_gain;
}

}  // namespace fork1s::reference
