// By what rule a body takes a step.
#pragma once

namespace fork1s {

/// docs/method.md, section 5. The last two make the step of second order: nothing touches, and contacts are
/// looked for half way; or something lasts in contact, and the past step is known.
enum class StepRule { kEuler, kMiddle, kTwoSteps };

}  // namespace fork1s
