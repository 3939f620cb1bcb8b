// What an impact is: contacts and stops that are met at speed.
#pragma once

#include <limits>

#include "contact_history.hpp"
#include "rows.hpp"

namespace fork1s {

/// How what may touch approaches.
struct Approaches {
  /// `step`: the whole step, of which the one at hand may be a part.
  void SetSpeeds(const StepOptions& step);

  std::vector<double> rebound;      // m/s, per contact that may part again; 0 for others
  std::vector<double> pose_gaps;    // m, per contact, at the pose of detection
  std::vector<double> closing;      // m/s, per contact, at the start of the step or stage
  std::vector<StopApproach> stops;  // of ConstraintRows::limits
  double impact_speed = 0;          // m/s
  double carried_speed = 0;         // m/s, below which a contact that bore a load in the last step goes on
};

/// Sizes a second at which what the first stage stopped may part again in the second: the extrapolation between
/// the stages would turn a speed v into 1.4 v the other way. A speed, since it lasts however short the step is.
inline constexpr double kPartingRate = 2e-4;

/// What a step of length h, or a stage of it, knows when it looks for impacts.
struct ImpactView {
  const Detection& detection;
  const ContactHistory& history;
  const ConstraintRows& rows;
  const Approaches& approaches;

  /// Whether a contact bore a load before: in the last step; in the second stage in the first too, where one that lasts
  /// from the start of the step may have closed a gap at any speed, which what rolls fast seems to open.
  bool CarriedLoad(std::size_t contact) const {
    return history.CarriedAtRest(contact, approaches.carried_speed) || history.Lasts(contact);
  }
};
/// The contact that bore nothing yet and would close first at the speed of an impact, if all went on.
struct PredictedImpact {
  StepSubject of;
  double time = std::numeric_limits<double>::infinity();  // s, from the start of the step
};
PredictedImpact FindPredictedImpact(const ImpactView& at);
// Each gives the first that it finds, kNone if there is none.
/// What the step has brought together at the speed of an impact: from the start, or from so far that it took that
/// speed; contacts, stops of joints and tendons.
StepSubject FindImpact(const ImpactView& at, double h);
/// What the first stage stopped and parts again in the second.
StepSubject FindParting(const ImpactView& at, const std::vector<StopHistory>& stops);
/// A stop, or with `contacts`, whose gaps are those of base points, a contact, that carried no load at the
/// start of the step and that the base point of the second stage lies beyond. From there a stage may go on
/// without a force: what overlaps is pushed apart at a bounded speed only.
StepSubject FindBeyondAtBasePoint(const ImpactView& at, double h, bool contacts);
/// Whether the predicted motion to the pose of detection, which the margin covers, may have led past
/// something: by more than half of the sum of two inner radii. Beyond that sum the least way out of a pair is
/// on the far side; half of it leaves room for edges. Or in through another face than the one that the predicted pose,
/// a stage of length h on, shows: along its normal two shapes that carried no load overlap at the base point already.
bool MayHavePassed(const ImpactView& at, double h);
/// Two shapes that a solved stage has led through each other: its contact at the end shows a face along whose normal the
/// points that touch there overlapped at the start of the stage by more than half of the sum of two inner radii.
StepSubject FindTunnelling(const ImpactView& at);

}  // namespace fork1s
