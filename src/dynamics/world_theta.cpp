// The step of second order among contacts: where they are found, and what an impact is.
#include <algorithm>
#include <cmath>

#include "world_detail.hpp"

namespace fork1s {

bool World::Detail::UsesTheta(const StepOptions& options) const {
  return options.integrator == Integrator::kTheta &&
         std::all_of(mechanisms_.begin(), mechanisms_.end(),
                     [](const auto& m) { return m.recovery() != Recovery::kTwist; });
}

// Largest way of a contactor within h at its present velocity [m].
double World::Detail::MotionWithin(double h) const {
  double motion = 0;
  for (std::size_t i = 0; i < contactors_.size(); ++i) {
    const Contactor& c = contactors_[i];
    if (c.kind == Contactor::Kind::kWorld) continue;
    const auto index = static_cast<std::size_t>(c.index);
    const Vector6 V = c.kind == Contactor::Kind::kGroup ? GroupVelocity(mechanisms_[index], c.group)
                                                        : free_bodies_[index].OriginVelocity();
    motion = std::max(motion, h * (V.tail<3>().norm() + V.head<3>().norm() * contactor_radius_[i]));
  }
  return motion;
}

// By the contacts and stops at hand.
bool World::Detail::MayBeTouched(std::size_t mechanism) const {
  const auto& parts = mechanism_blocks_[mechanism].parts;
  return std::any_of(parts.begin(), parts.end(), [](const PartBlock& p) { return p.rows > 0; });
}

void World::Detail::FindTouchedBodies() {
  touched_.assign(free_bodies_.size(), 0);
  for (const ContactPoint& p : points_)
    for (const int body : {p.body_a, p.body_b})
      if (const Contactor& c = contactors_[static_cast<std::size_t>(body)];
          c.kind == Contactor::Kind::kFreeBody)
        touched_[static_cast<std::size_t>(c.index)] = 1;
}

// What nothing can touch within the step, by the contacts at hand, and no stop, goes half way in any case.
void World::Detail::BeginAll(const StepOptions& options, StepRule rule) {
  rule_ = rule;
  const PartClock clock(times_, &StepPartTimes::moving);
  ForMechanisms([&](std::size_t i) {
    if (mechanisms_[i].recovery() == Recovery::kTwist) return;
    const bool free = !MayBeTouched(i);
    // By implicit Euler a pull, however stiff its spring, knows how the pose of the start gives way (RespondAt).
    const bool pulled = rule == StepRule::kEuler && mechanisms_[i].has_loads();
    MechanismDynamics& m = mechanisms_[i];
    if (rule != StepRule::kEuler) {
      Begin(m, options.h, options.gravity, free ? StepRule::kMiddle : rule);
    } else if (free && !pulled && GoesHalfWay(m.step_model())) {
      Begin(m, options.h, options.gravity, StepRule::kMiddle);
      ActAtEnd(m);
    } else {
      Begin(m, options.h, options.gravity, rule);
      if (free && !pulled) ExpectNothing(m, options.h);
    }
  });
  if (rule == StepRule::kEuler) return;
  for (std::size_t i = 0; i < free_bodies_.size(); ++i)
    free_bodies_[i].Begin(options.h, rule == StepRule::kTwoSteps && touched_[i] ? rule : StepRule::kMiddle);
}

// Whether anything that may touch has no past to go on from.
bool World::Detail::AnyBeginsAnew(double h) {
  for (std::size_t i = 0; i < mechanisms_.size(); ++i)
    if (MayBeTouched(i) && BeginsAnew(mechanisms_[i], h)) return true;
  FindTouchedBodies();
  for (std::size_t i = 0; i < free_bodies_.size(); ++i)
    if (touched_[i] && free_bodies_[i].BeginsAnew(h)) return true;
  return false;
}

// Whether anything bore a load in the last step.
bool World::Detail::AnythingTouches() const {
  return std::any_of(previous_.begin(), previous_.end(), [](const auto& c) { return c.impulse(0) > 0; });
}

// Whether a contact bore a load in the last step.
bool World::Detail::Bore(std::size_t contact) const { return CarriedAtRest(contact, carried_speed_); }

// By two stages what only closed its gap by the end of the last step, at this speed [m/s] or faster, is still
// to be met.
bool World::Detail::CarriedAtRest(std::size_t contact, double speed) const {
  if (match_[contact] < 0) return false;
  const ContactRecord& before = previous_[static_cast<std::size_t>(match_[contact])];
  return before.impulse(0) > 0 && (!two_stage_ || before.end_speed > -speed);
}

// Speed of an impact: more than gravity gives in an eighth of the step, or any where things part again. Parts of a
// two-stage step go by the whole.
double World::Detail::ImpactSpeedOf(const StepOptions& options) { return options.gravity.norm() * options.h / 8; }
double World::Detail::SpeedOfImpact(const StepOptions& options) const {
  return two_stage_ ? impact_speed_ : ImpactSpeedOf(options);
}
double World::Detail::SpeedOfImpact(const StepOptions& options, const ContactPoint& point) const {
  return point.restitution > 0 ? 0 : SpeedOfImpact(options);
}

// Radius [m] of the smaller of two shapes that touch.
double World::Detail::PairSize(const ContactPoint& p) const {
  const auto radius = [&](int body, int geometry) {
    return geometry_radius_[static_cast<std::size_t>(body)][static_cast<std::size_t>(geometry)];
  };
  return std::min(radius(p.body_a, p.geometry_a), radius(p.body_b, p.geometry_b));
}

// A contact that bore nothing yet and would close within the step at the speed of an impact, if all went on.
bool World::Detail::ClosesAtSpeed(const StepOptions& options, StepSubject* subject) const {
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (Bore(i) || !(closing_[i] > SpeedOfImpact(options, points_[i])) ||
        !(points_[i].gap < options.h * closing_[i]))
      continue;
    if (subject) *subject = {StepSubject::Kind::kContact, points_[i].body_a, points_[i].body_b};
    return true;
  }
  return false;
}

World::Detail::StopApproach World::Detail::ApproachOf(const MechanismDynamics& m,
                                                      const Mechanism::LengthLimit& stop, bool upper) const {
  const auto& terms = stop.length.terms;
  const bool turns =
      stop.length.path < 0 && !terms.empty() && m.mechanism().Turns(terms.front().first);
  const double scale = turns ? m.mechanism().length_scale() : 1, length = m.Length(stop.length),
               rate = from_stage_start_ ? LengthRateAtStageStart(m, stop.length) : LengthRate(m, stop.length);
  return {false,
          scale * (upper ? stop.upper - length : length - stop.lower),
          scale * (upper ? rate : -rate),
          0,
          m.mechanism().length_scale(),
          scale};
}

// The same of what the step has brought together, and of stops of joints and tendons: at that speed from the start, or
// from so far that it took that speed.
bool World::Detail::MetAtSpeed(const StepOptions& options, StepSubject* subject) const {
  const double least = SpeedOfImpact(options);
  for (std::size_t k = 0; k < stop_approach_.size(); ++k) {
    const StopApproach& a = stop_approach_[k];
    if (a.bore || !(limits_[k].impulse > 0) || !(a.speed > least || a.gap > options.h * least)) continue;
    if (subject) *subject = {StepSubject::Kind::kStop, a.mechanism, a.stop};
    return true;
  }
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!(constraints_[i].impulse(0) > 0) || Bore(i)) continue;
    const double speed = SpeedOfImpact(options, points_[i]);
    if (!(closing_[i] > speed || points_[i].gap > options.h * speed)) continue;
    if (subject) *subject = {StepSubject::Kind::kContact, points_[i].body_a, points_[i].body_b};
    return true;
  }
  return false;
}

// Whether what overlapped from the start is pushed apart at the speed of an impact.
bool World::Detail::PushesApart(const StepOptions& options) const {
  // m, pushed apart at that speed (contact/material.hpp)
  const double depth = (1 + options.material.relaxation_steps) * options.h * SpeedOfImpact(options);
  for (std::size_t i = 0; i < points_.size(); ++i)
    if (!Bore(i) && constraints_[i].impulse(0) > 0 && -points_[i].gap > depth) return true;
  return false;
}

// No parabola goes through such a step: the next one begins anew.
void World::Detail::ForgetPasts() {
  for (MechanismDynamics& m : mechanisms_) ForgetPast(m);
  for (FreeBody& b : free_bodies_) b.ForgetPast();
}

// What may touch anything takes all forces at the end of the step.
void World::Detail::ExpectContacts() {
  for (std::size_t i = 0; i < mechanisms_.size(); ++i) {
    const auto& parts = mechanism_blocks_[i].parts;
    const auto involves = [&](int contactor) {
      const Contactor& c = contactors_[static_cast<std::size_t>(contactor)];
      return c.kind == Contactor::Kind::kGroup && c.index == static_cast<int>(i);
    };
    // A servo that gives all it can follows nothing; its bound is a force of the end.
    if (mechanisms_[i].NumForcesAtBound() > 0) {
      ActAtEnd(mechanisms_[i]);
      continue;
    }
    ExpectContact(mechanisms_[i], std::any_of(parts.begin(), parts.end(),
                                              [](const PartBlock& p) { return !p.limits.empty(); }) ||
                                      std::any_of(points_.begin(), points_.end(), [&](const ContactPoint& p) {
                                        return involves(p.body_a) || involves(p.body_b);
                                      }));
  }
}

// Contacts are found at the start, and all forces act at the end.
void World::Detail::BeginEuler(const StepOptions& options, StepReport& report) {
  PrepareContacts(options, report);
  BeginAll(options, StepRule::kEuler);
}

// Where something lasts in contact, contacts are found at the start of the step. Where nothing touches they
// are looked for half way; what moves by more than a millimetre until there could be past a fingertip by
// then, and is looked for at the start too. An impact is taken from there.
void World::Detail::BeginTheta(const StepOptions& options, StepReport& report) {
  constexpr double kBlind = 1e-3;  // m
  const bool touches = AnythingTouches(), fast = MotionWithin(0.5 * options.h) > kBlind;
  if (touches) rule_ = StepRule::kTwoSteps;
  if (touches || fast) {
    PrepareContacts(options, report);
    report.impact = ClosesAtSpeed(options);
    if (report.impact) return;
    begins_anew_ = touches && AnyBeginsAnew(options.h);
    if (begins_anew_) return;
  }
  if (touches) {
    BeginAll(options, StepRule::kTwoSteps);
    return;
  }
  BeginAll(options, StepRule::kMiddle);
  PrepareContacts(options, report);
  report.impact = !fast && ClosesAtSpeed(options);
  if (!report.impact) ExpectContacts();
}

}  // namespace fork1s
