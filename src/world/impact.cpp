// What an impact is: contacts and stops that are met at speed.
#include <algorithm>
#include <cmath>

#include "detail.hpp"

namespace fork1s {

void World::Detail::FindTouchedBodies() {
  touched_.assign(bodies_.free_bodies.size(), 0);
  for (const ContactPoint& p : detection_.points)
    for (const int body : {p.body_a, p.body_b})
      if (const Contactor& c = detection_.contactors[static_cast<std::size_t>(body)];
          c.kind == Contactor::Kind::kFreeBody)
        touched_[static_cast<std::size_t>(c.index)] = 1;
}

// Whether a contact bore a load in the last step.
bool World::Detail::Bore(std::size_t contact) const { return CarriedAtRest(contact, carried_speed_); }

// What only closed its gap by the end of the last step, at this speed [m/s] or faster, is still to be met.
bool World::Detail::CarriedAtRest(std::size_t contact, double speed) const {
  if (match_[contact] < 0) return false;
  const ContactRecord& before = previous_[static_cast<std::size_t>(match_[contact])];
  return before.impulse(0) > 0 && before.end_speed > -speed;
}

// m/s; what has restitution parts again from any.
double World::Detail::SpeedOfImpact(const ContactPoint& point) const {
  return point.restitution > 0 ? 0 : impact_speed_;
}

// A contact that bore nothing yet and would close within the step at the speed of an impact, if all went on.
bool World::Detail::ClosesAtSpeed(const StepOptions& options, StepSubject* subject) const {
  for (std::size_t i = 0; i < detection_.points.size(); ++i) {
    if (Bore(i) || !(closing_[i] > SpeedOfImpact(detection_.points[i])) ||
        !(detection_.points[i].gap < options.h * closing_[i]))
      continue;
    if (subject)
      *subject = {StepSubject::Kind::kContact, detection_.points[i].body_a, detection_.points[i].body_b};
    return true;
  }
  return false;
}

// Lengths that turn, in rad, count by the length of the mechanism.
double World::Detail::MetersPerUnit(const MechanismDynamics& m, const Mechanism::Length& length) {
  const bool turns =
      length.path < 0 && !length.terms.empty() && m.mechanism().Turns(length.terms.front().first);
  return turns ? m.mechanism().length_scale() : 1;
}

World::Detail::StopApproach World::Detail::ApproachOf(const MechanismDynamics& m,
                                                      const Mechanism::LengthLimit& stop, bool upper) const {
  const double scale = MetersPerUnit(m, stop.length), length = m.Length(stop.length),
               rate = from_stage_start_ ? LengthRateAtStageStart(m, stop.length) : LengthRate(m, stop.length);
  return {false,
          scale * (upper ? stop.upper - length : length - stop.lower),
          scale * (upper ? rate : -rate),
          0,
          m.mechanism().length_scale(),
          scale};
}

// The same of what the step has brought together, and of stops of joints and tendons: at that speed from the
// start, or from so far that it took that speed.
bool World::Detail::MetAtSpeed(const StepOptions& options, StepSubject* subject) const {
  const double least = impact_speed_;
  for (std::size_t k = 0; k < stop_approach_.size(); ++k) {
    const StopApproach& a = stop_approach_[k];
    if (a.bore || !(rows_.limits[k].impulse > 0) || !(a.speed > least || a.gap > options.h * least)) continue;
    if (subject) *subject = {StepSubject::Kind::kStop, a.mechanism, a.stop};
    return true;
  }
  for (std::size_t i = 0; i < detection_.points.size(); ++i) {
    if (!(rows_.contacts[i].impulse(0) > 0) || Bore(i)) continue;
    const double speed = SpeedOfImpact(detection_.points[i]);
    if (!(closing_[i] > speed || detection_.points[i].gap > options.h * speed)) continue;
    if (subject)
      *subject = {StepSubject::Kind::kContact, detection_.points[i].body_a, detection_.points[i].body_b};
    return true;
  }
  return false;
}

// Whether what the first stage stopped parts again in the second, of length b.
bool World::Detail::LeavesAgain(double b, StepSubject& subject) const {
  for (std::size_t i = 0; i < detection_.points.size(); ++i) {
    const int before = match_[i];
    if (before < 0 || !previous_is_fresh_[static_cast<std::size_t>(before)] ||
        rows_.contacts[i].impulse(0) > 0)
      continue;
    if (!(b * RelativeSpeed(rows_.contacts[i], rows_.velocities)(0) >
          kPartingShare * detection_.shapes.PairSize(detection_.points[i])))
      continue;
    subject = {StepSubject::Kind::kContact, detection_.points[i].body_a, detection_.points[i].body_b};
    return true;
  }
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i) {
    const MechanismRows& block = rows_.mechanisms[i];
    std::size_t k = block.first_limit;
    for (const PartRows& part : block.parts) {
      for (const int at : part.limits) {
        const LimitConstraint& limit = rows_.limits[k];
        const StopApproach& stop = stop_approach_[k++];
        if (!stops_[i].is_fresh[static_cast<std::size_t>(at)] || limit.impulse > 0 ||
            !(b * stop.scale * limit.sign * rows_.velocities(limit.row) > kPartingShare * stop.size))
          continue;
        subject = {StepSubject::Kind::kStop, static_cast<int>(i), at / 2};
        return true;
      }
      k += part.frictions.size();
    }
  }
  return false;
}

}  // namespace fork1s
