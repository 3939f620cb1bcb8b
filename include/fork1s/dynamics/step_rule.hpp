// By what rule a body takes a step.
#pragma once

namespace fork1s {

/// docs/method.md, section 5. kMiddle and kTwoSteps make the step of `theta`: nothing touches, and contacts are
/// looked for half way; or something lasts in contact, and the past step is known. kStage: an implicit stage of the
/// two-stage scheme.
enum class StepRule { kEuler, kMiddle, kTwoSteps, kStage };

/// Whether a parabola through the velocities v⁻ and v at the ends of a step that began anew, as after an impact, goes on
/// to more than v though nothing drives it there. That step turned the motion back; or it stopped so much that the
/// parabola would bring it all back, |2 v - v⁻| > |v|, where what was left is less than what there had been. Given are
/// the products <v, v>, <v⁻, v⁻> and <v⁻, v> of the kinetic metric.
inline bool ParabolaComesBack(double now, double before, double both) {
  return both < 0 || (now < before && 3 * now - 4 * both + before > 0);
}

}  // namespace fork1s
