// How poses follow from reduced coordinates.
#pragma once

namespace fork1s {

/// How interface poses follow from z, and with them all others.
enum class Recovery {
  kExact,  ///< product of exponentials, loops closed
  kTwist,  ///< one exponential a body of the summed screws: the paper's parallel mode
};

}  // namespace fork1s
