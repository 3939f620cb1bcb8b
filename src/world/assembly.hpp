// The rows of contacts and stops, and what they know of the step before.
#pragma once

#include <optional>

#include "bodies.hpp"
#include "impact.hpp"

namespace fork1s {

/// What is being solved.
struct StageAtHand {
  bool within = false;             // a stage; else contacts are those at the start of the step
  bool is_backward_euler = false;  // the step, or its part, is one stage
  bool rows_from_start = false;  // rows are those of the pose where the stage starts, else of that found last
  bool all_stops = false;        // all stops are rows
  double artificial_damping = 0;        // of the part at hand, SetArtificialDamping
  std::optional<int> damped_mechanism;  // the one that it is of; none: of all
  bool keeps_contacts =
      false;  // points, normals and gaps of the base point are those of an earlier iteration
};

/// Rows of the contact points, whose gaps become those at the base point of the stage. `options.h`: of the
/// stage.
void AssembleContacts(const StageAtHand& stage, const StepOptions& options, const ContactHistory& history,
                      Detection& detection, Approaches& approaches, ConstraintRows& rows);
/// Rows of the stops and dry frictions that take part.
void AssembleStops(const Bodies& bodies, const StageAtHand& stage, const StepOptions& options,
                   const std::vector<StopHistory>& stops, Approaches& approaches, ConstraintRows& rows);
/// After AssembleOperators: bounds the speed at which what is beyond a stop is pushed back.
void BoundRecoveryMomentum(const Bodies& bodies, ConstraintRows& rows);
/// What is met within the step and has restitution parts again, once the free motion is known.
void Rebound(const Detection& detection, const Approaches& approaches, double h, ConstraintRows& rows);
/// Stops and dry friction start from the forces that they bore: impulses times the ratio of lengths of steps.
void StartStops(double steps_ratio, std::vector<StopHistory>& stops);
/// Which stops carried load at the start of a step, and their gaps there.
void RecordStops(Bodies& bodies, const StageAtHand& stage, double impact_speed,
                 std::vector<StopHistory>& stops);

/// Forces that change sides within a step (force_limits.cpp, slack.cpp): those that mechanisms now leave to
/// the solve get their rows, and all of these are assembled again.
void AddBoundedForceRows(Bodies& bodies, double h, ConstraintRows& rows);
/// Mechanisms take the sides that the solve found.
void SetSidesFound(double h, Bodies& bodies, const ConstraintRows& rows);

}  // namespace fork1s
