#include "contact_history.hpp"

#include <cmath>
#include <limits>

namespace fork1s {

constexpr double kNoGap = std::numeric_limits<double>::quiet_NaN();

void ContactHistory::Reserve(std::size_t count) {
  contacts.reserve(count);
  match.reserve(count);
  start_gap.reserve(count);
  next_start_gap_.reserve(count);
  matcher_.Reserve(count);
}

void ContactHistory::Store(std::vector<ContactRecord>& records, double h,
                           const std::vector<RigidTransform>& X) {
  contacts.swap(records);
  length = h;
  poses = X;
}

void ContactHistory::StartStep() {
  start_gap.assign(contacts.size(), kNoGap);
  to_base_point.assign(contacts.size(), Vector6::Zero());
}

void ContactHistory::Match(const Detection& detection) {
  matcher_.Match(detection.shapes, detection.points, detection.poses, contacts, poses, match);
}

void ContactHistory::RecordStartGaps(const std::vector<ContactPoint>& points, double speed) {
  for (std::size_t i = 0; i < points.size(); ++i)
    if (CarriedAtRest(i, speed)) start_gap[static_cast<std::size_t>(match[i])] = points[i].gap;
}

void ContactHistory::CarryStartGaps() {
  next_start_gap_.resize(match.size());
  for (std::size_t i = 0; i < match.size(); ++i) next_start_gap_[i] = StartGap(i);
  start_gap.swap(next_start_gap_);
}

const ContactRecord* ContactHistory::Before(std::size_t contact) const {
  return match[contact] < 0 ? nullptr : &contacts[static_cast<std::size_t>(match[contact])];
}

bool ContactHistory::CarriedAtRest(std::size_t contact, double speed) const {
  const ContactRecord* before = Before(contact);
  return before && before->impulse(0) > 0 && before->end_speed > -speed;
}

bool ContactHistory::Lasts(std::size_t contact) const {
  const ContactRecord* before = Before(contact);
  return before && before->impulse(0) > 0 && !std::isnan(StartGap(contact));
}

double ContactHistory::StartGap(std::size_t contact) const {
  return match[contact] < 0 ? kNoGap : start_gap[static_cast<std::size_t>(match[contact])];
}

}  // namespace fork1s
