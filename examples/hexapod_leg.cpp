#include <cmath>
#include <numbers>

#include "motions.hpp"

namespace fork1s::examples {

LegAngles Reach(double x, double y, double z) {
  constexpr double kCoxa = 0.03;
  const double a = std::hypot(0.07, 0.04), b = std::hypot(0.02, 0.12);
  const double reach = std::hypot(x, y) - kCoxa, d = std::hypot(reach, z);
  const double at_hip = std::acos((a * a + d * d - b * b) / (2 * a * d));
  const double at_knee = std::acos((a * a + b * b - d * d) / (2 * a * b));
  const double femur = std::atan2(z, reach) + at_hip, tibia = femur - std::numbers::pi + at_knee;
  return {std::atan2(y, x), femur - std::atan2(0.04, 0.07),
          tibia - femur - (std::atan2(-0.12, 0.02) - std::atan2(0.04, 0.07))};
}

}  // namespace fork1s::examples
