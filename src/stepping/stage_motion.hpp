// What an implicit stage has moved something by: what the tolerance of its equation is a share of.
#pragma once

namespace fork1s {

/// In the kinetic metric, √(vᵀ M v / m) b of a velocity v over the length b of the stage [m].
struct StageMotion {
  double motion = 0;           // by its velocity, beside the drift of a base or centre of mass
  double velocity_change = 0;  // by what its velocity has changed by since the start of the step
};

/// Of a Newton iteration, in that metric.
struct StageChange : StageMotion {
  double change = 0;       // m, of position, that this one makes
  double square = 0;       // kg m²/s²: of the change of velocity that it makes
  double with_before = 0;  // kg m²/s²: product of that change with the one of the iteration before
};

}  // namespace fork1s
