// How well a stage is solved, and when that is enough.
#pragma once

#include <array>
#include <vector>

#include "bodies.hpp"
#include "scheme.hpp"

namespace fork1s {

/// At the pose found.
struct StageResidual {
  double ratio = 0;       // largest residual, in tolerances
  double largest = 0;     // m
  StepSubject subject;    // of the largest ratio
  double negligible = 0;  // largest residual, as a share of what is too small to matter, as the motion goes
  bool is_small =
      true;  // every residual is within its tolerance or a share of the length that noise may leave
  bool is_slow = false;  // the iteration contracts so slowly that a new matrix is worth its cost
};

/// What an iteration changes of all bodies.
struct Changes {
  double square = 0;       // of the change of velocity in the kinetic metric, kg m²/s²
  double with_before = 0;  // its product with the change of the iteration before, likewise
  double ratio = 0;        // largest change of position, in tolerances
  double share = 0;        // the same as a share of the length of what it moves
};

/// Newton's iteration of stages.
struct NewtonIteration {
  // As measured last: [1] in the second of two stages, whose matrix is older, [0] in others.
  std::array<double, 2> contraction = {1, 1};
  std::vector<StageChange> changes;  // scratch, per mechanism
  Changes changes_before;            // by the last iteration, if the next is to be compared with it
  // Share of its change that an iteration which swings about its limit takes back; 0 where it does not.
  double relaxation = 0;
};

/// Where an iteration of a stage ends.
struct StageEnd {
  StageScheme scheme = StageScheme::kBackwardEuler;
  double b = 0, time = 0;  // s: of the stage, from the start of the step to its end
  double tolerance = 0;    // StepOptions::newton_tolerance
  bool is_first = true;    // of the iterations
  bool may_accept = true;  // without an evaluation, where the contraction promises as much
  bool measures = true;    // the contraction
  // What swings is relaxed however much the iterations change, and none moves a mechanism farther than a share of
  // its length.
  bool is_last_resort = false;
};
/// Ends a Newton iteration: everything moves to the pose found. Where mechanisms change so little that by the
/// contraction seen last the next iteration would change less than the tolerance, their stage is accepted
/// without another evaluation.
StageResidual MoveAndComputeResiduals(const StageEnd& at, Bodies& bodies, NewtonIteration& newton);

/// Where the last iterations swing about their limit and come nearer too slowly, or not at all, everything moves back to
/// a pose between the last two. What a loaded contact lets turn makes them swing.
void RelaxSwinging(double b, double time, Bodies& bodies, NewtonIteration& newton);

/// A force whose saturation differs between the two stages, of length b, and changes by so much that its
/// extrapolation, s b Δf of momentum, moves something by more than the tolerance; kNone if there is none. A
/// stage without the spring of a servo is not L-stable in it.
StepSubject FindSaturationChange(Bodies& bodies, double b);

}  // namespace fork1s
