// What may be met within a stage: how far contacts and stops are sought, and from which pose.
//
// A stage finds contacts at the pose that its predicted velocity leads to, within a margin. The velocity
// found may lead farther than that, by servos, pushes and impacts of the stage itself, and what is met beyond
// the margin would be passed. So the motion from the pose of detection to the pose found is compared with the
// margin; where it is longer, the iteration is repeated with contacts within that motion.
//
// Contacts of such an iteration are those of the pose where the stage starts, as speculative contacts are (E.
// Catto, GDC 2013): at a pose beyond the middle of a thin body the normal points to the far side. An
// iteration from there is never the last: the next one linearizes at the pose found.
#include <algorithm>
#include <cmath>

#include "detail.hpp"

namespace fork1s {
// Whether the predicted motion to the pose of detection, which the margin covers, may have led past something:
// by more than half of the sum of two inner radii. Beyond that sum the least way out of a pair is on the far
// side; half of it leaves room for edges.
bool World::Detail::MayHavePassed() {
  bool may = false;
  for (std::size_t i = 0; i < detection_.points.size() && !may; ++i) {
    const ContactPoint& p = detection_.points[i];
    const auto a = static_cast<std::size_t>(p.body_a), b = static_cast<std::size_t>(p.body_b);
    const double motion = detection_.motion[a] + detection_.motion[b];
    may = detection_.points[i].gap < motion && !Bore(i) && motion > 0.5 * detection_.shapes.InnerPairSize(p);
  }
  if (may) detection_.least_margin = std::max(detection_.least_margin, 2 * detection_.LargestPairMotion());
  return may;
}

void World::Detail::RecordStageStart(bool of_step) {
  for (MechanismDynamics& m : bodies_.mechanisms) fork1s::RecordStageStart(m, of_step);
  for (FreeBody& body : bodies_.free_bodies) body.RecordStageStart(of_step);
  detection_.RecordStageStart(bodies_);
}

// Contacts at the pose where the stage, of length b, starts.
bool World::Detail::PrepareContactsAtStageStart(const StepOptions& stage, StepReport& report) {
  {
    const PartClock clock(times_, &StepPartTimes::moving);
    bodies_.ForMechanisms([&](std::size_t i) { MoveToStageStart(bodies_.mechanisms[i], stage.h); });
    for (FreeBody& body : bodies_.free_bodies) body.MoveToStageStart(stage.h);
  }
  from_stage_start_ = true;
  if (!PrepareContacts(stage, report)) return false;
  bodies_.ForMechanisms([&](std::size_t i) {
    RestoreStageBaseTwist(bodies_.mechanisms[i]);
    EvaluateStage(bodies_.mechanisms[i], stage.h);
  });
  return true;
}

// Whether contacts and stops were sought as far as the pose found is from that of detection. Else the next
// iteration seeks them there.
bool World::Detail::CoversMotion() {
  const bool covers = detection_.CoversMotion(bodies_);
  const bool stops = all_stops_ || !PassesStop();
  all_stops_ = all_stops_ || !stops;
  return covers && stops;
}

// Whether the base point of the second stage lies beyond a contact or stop that carried no load at the start
// of the step. From there a stage may go on without a force: what overlaps is pushed apart at a bounded speed
// only.
bool World::Detail::BasePointIsBeyond(const StepOptions& options, StepSubject& subject) const {
  for (const StopApproach& a : stop_approach_) {
    if (a.bore || !(a.base_gap < -options.h * impact_speed_)) continue;
    subject = {StepSubject::Kind::kStop, a.mechanism, a.stop};
    return true;
  }
  for (std::size_t i = 0; from_stage_start_ && i < detection_.points.size(); ++i) {
    if (Bore(i) || !(detection_.points[i].gap < -options.h * SpeedOfImpact(detection_.points[i]))) continue;
    subject = {StepSubject::Kind::kContact, detection_.points[i].body_a, detection_.points[i].body_b};
    return true;
  }
  return false;
}

// Whether a stop without a row is violated at the pose found.
bool World::Detail::PassesStop() const {
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i) {
    const MechanismDynamics& m = bodies_.mechanisms[i];
    if (m.step_model().parts.empty()) continue;
    const std::vector<char>& is_row = stops_[i].is_row;
    for (std::size_t k = 0; k < m.length_limits().size(); ++k) {
      if (is_row[2 * k] && is_row[2 * k + 1]) continue;
      const Mechanism::LengthLimit& limit = m.length_limits()[k];
      const double length = m.Length(limit.length);
      if ((!is_row[2 * k] && length < limit.lower) || (!is_row[2 * k + 1] && length > limit.upper))
        return true;
    }
  }
  return false;
}

}  // namespace fork1s
