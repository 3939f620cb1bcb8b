// What an implicit stage has moved something by: what the tolerance of its equation is a share of.
#pragma once

namespace fork1s {

/// In the kinetic metric, √(vᵀ M v / m) b of a velocity v over the length b of the stage [m].
struct StageMotion {
  double motion = 0;           // by its velocity, beside the drift of a base or centre of mass
  double velocity_change = 0;  // by what its velocity has changed by since the start of the step
};

/// Of two Newton iterations k - 1 and k of a stage, each with the change of velocity d that its contact solve
/// made: sums over all that moves, in the kinetic metric [J].
struct StageSecant {
  double along = 0;    // d_k M (d_k - d_{k-1})
  double squared = 0;  // (d_k - d_{k-1}) M (d_k - d_{k-1})
};

}  // namespace fork1s
