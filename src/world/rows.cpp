// The rows of contacts and stops.
#include <algorithm>
#include <cmath>
#include <limits>

#include "detail.hpp"

namespace fork1s {
// Stops and dry friction in a stage of length b start from the forces that they bore in the last one.
void World::Detail::StartRows(double b) {
  const double by_step = history_.StepsRatio(b);
  for (StopHistory& stops : stops_) {
    for (std::vector<double>* impulses : {&stops.impulses, &stops.friction_impulses})
      for (double& impulse : *impulses) impulse *= by_step;
    stops.friction_held = stops.friction_impulses;
  }
}

// The rows of a contact, and what they know of the last step.
void World::Detail::AssembleContact(std::size_t i, const StepOptions& options) {
  const double h = options.h;
  ContactPoint& p = detection_.points[i];
  ContactConstraint& c = rows_.contacts[i];
  c = ContactConstraint{};
  c.friction = p.friction;
  c.torsion = p.torsion;
  c.rolling = p.rolling;
  const Contactor& a = detection_.contactors[static_cast<std::size_t>(p.body_a)];
  const Contactor& b = detection_.contactors[static_cast<std::size_t>(p.body_b)];
  if (a.kind != Contactor::Kind::kWorld) c.port_a = rows_.port_offset[static_cast<std::size_t>(p.body_a)];
  if (b.kind != Contactor::Kind::kWorld) c.port_b = rows_.port_offset[static_cast<std::size_t>(p.body_b)];
  if (c.port_a >= 0) c.J_a = -PortRows(detection_, rows_, p.body_a, p.point, p.frame);
  if (c.port_b >= 0) c.J_b = PortRows(detection_, rows_, p.body_b, p.point, p.frame);
  const Vector3 speed = RelativeSpeed(c, rows_.velocities);
  // A stage finds contacts at the pose that the velocity at hand leads to: this is the gap at its base point.
  if (in_stage_) p.gap -= h * speed(0);
  approaches_.closing[i] =
      std::max(0.0, -(from_stage_start_ ? RelativeSpeed(c, rows_.start_velocities) : speed)(0));
  if (const double start_gap = history_.StartGap(i); start_gap <= 0) p.gap = start_gap;
  SetMaterial(options.material, p.gap, h, c);
  // Of the two stages restitution would be extrapolated; a step that meets something that has it is halved. A stage of
  // backward Euler takes the approach from the velocity of its start, by the rows of its end.
  if (p.restitution > 0 && in_stage_ && is_backward_euler_)
    approaches_.rebound[i] = std::max(0.0, -RelativeSpeed(c, rows_.start_velocities)(0));
  // A body on the floor would fall upon all that is near, were nothing there to hold it: it goes on as it
  // did.
  c.waits = p.gap + h * speed(0) > kClearShare * detection_.shapes.PairSize(p);
  if (!history_.Before(i)) return;
  const ContactRecord& before = *history_.Before(i);
  c.waits = c.waits && before.impulse.isZero(0);
  // Surfaces bear a force; impulses are those of a step, the mean of both stages.
  const Matrix3 turned = p.frame * before.point.frame.transpose();
  const Vector6& onward = history_.to_base_point[static_cast<std::size_t>(history_.match[i])];
  c.held = c.impulse = h * (turned * (before.end_force + onward.tail<3>()));
  c.held_use = before.use;
  c.held_moment = c.moment = h * (turned * (before.end_moment + onward.head<3>()));
}

// Linearized at the pose of a stage, the gap of a contact, stop or tendon that lasts would come back as an
// error of position: of first order, as the gap bends. By the gap at the start of the step, gap/(h + τ) of a
// stage is stable for τ above 0.71 of its length.
//
// A stage of backward Euler that closes a gap leaves the velocity of the chord; what it stops is stopped in
// the next one, along the rows of its end. Where a length that a stop holds bends, as a taut string does that
// swings, that velocity runs on into the stop by half of what the stop's force changes in the stage. What
// closes slower than by all that it has changed in the last step, or part of one, is borne.
void World::Detail::RecordStops(double h) {
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i) {
    StopHistory& stops = stops_[i];
    for (std::size_t at = 0; at < stops.impulses.size(); ++at) {
      stops.carried[at] = stops.is_fresh[at] = 0;
      stops.start_gap[at] = std::numeric_limits<double>::quiet_NaN();
      if (!(stops.impulses[at] > 0)) continue;
      const Mechanism::LengthLimit& stop = bodies_.mechanisms[i].length_limits()[at / 2];
      const StopApproach a = ApproachOf(bodies_.mechanisms[i], stop, at % 2 == 1, from_stage_start_);
      const auto turned = [&] {
        return a.scale * stops.impulses[at] * RatePerImpulse(bodies_.mechanisms[i], stop.length);
      };
      if (!is_backward_euler_ && !(a.speed < approaches_.impact_speed) && !(a.speed < turned())) continue;
      stops.carried[at] = 1;
      stops.is_fresh[at] = h * a.speed > kPartingShare * a.size;
      stops.start_gap[at] = a.gap / a.scale;
    }
  }
}

// Contacts are those found at the start.
void World::Detail::RecordStartGaps() {
  for (std::size_t i = 0; i < detection_.points.size(); ++i)
    if (Impacts().Bore(i))
      history_.start_gap[static_cast<std::size_t>(history_.match[i])] = detection_.points[i].gap;
}

void World::Detail::AssembleConstraints(const StepOptions& options) {
  rows_.contacts.resize(detection_.points.size());
  approaches_.rebound.assign(detection_.points.size(), 0.0);
  approaches_.closing.assign(detection_.points.size(), 0.0);
  FindPortFrames(bodies_, detection_, rows_);
  ForContacts(detection_, [&](std::size_t i) { AssembleContact(i, options); });
  AssembleLimits(options);
}

// Every mechanism's rows have their place before they are known, so that mechanisms fill them side by side.
void World::Detail::AssembleLimits(const StepOptions& options) {
  std::size_t count = 0;
  for (MechanismRows& block : rows_.mechanisms) {
    block.first_limit = count;
    for (const PartRows& part : block.parts) count += part.limits.size() + part.frictions.size();
  }
  rows_.limits.assign(count, LimitConstraint());
  approaches_.stops.assign(count, StopApproach());
  rows_.bounded_forces.clear();
  bodies_.ForMechanisms([&](std::size_t i) { FillLimits(i, options); });
}

void World::Detail::FillLimits(std::size_t i, const StepOptions& options) {
  const double h = options.h;
  const MechanismDynamics& m = bodies_.mechanisms[i];
  const StopHistory& stops = stops_[i];
  auto next = rows_.limits.begin() + static_cast<std::ptrdiff_t>(rows_.mechanisms[i].first_limit);
  for (const PartRows& part : rows_.mechanisms[i].parts) {
    for (std::size_t k = 0; k < part.limits.size(); ++k) {
      const auto at = static_cast<std::size_t>(part.limits[k]);
      const Mechanism::LengthLimit& stop = m.length_limits()[at / 2];
      const bool upper = at % 2 == 1;
      const double length = m.Length(stop.length);
      LimitConstraint& limit = *next++;
      limit.row = part.offset + static_cast<int>(part.LimitRow(k));
      limit.sign = upper ? -1 : 1;
      const double moved = in_stage_ ? h * LengthRate(m, stop.length) : 0;
      const double gap = upper ? stop.upper - length + moved : length - moved - stop.lower;
      limit.bias = in_stage_ && stops.start_gap[at] <= 0 ? StopBias(options.material, stops.start_gap[at], h)
                                                         : StopBias(options.material, gap, h);
      limit.impulse = stops.impulses[at];
      // One that bore may have only closed its gap: what of the speed is left counts there too.
      if (in_stage_) {
        StopApproach& approach = approaches_.stops[static_cast<std::size_t>(&limit - rows_.limits.data())];
        approach = ApproachOf(m, stop, upper, from_stage_start_);
        approach.mechanism = static_cast<int>(i);
        approach.stop = static_cast<int>(at / 2);
        approach.base_gap = approach.scale * gap;
        approach.bore = stops.carried[at];
      }
    }
    for (std::size_t k = 0; k < part.frictions.size(); ++k) {
      const auto at = static_cast<std::size_t>(part.frictions[k]);
      LimitConstraint& friction = *next++;
      friction.row = part.offset + static_cast<int>(part.FrictionRow(k));
      friction.upper = h * m.mechanism().frictions()[at].force;
      friction.lower = -friction.upper;
      friction.held = stops.friction_held[at];
      friction.impulse = stops.friction_impulses[at];
    }
  }
}

// What is met within the step and has restitution parts again, once the free motion is known.
void World::Detail::Rebound(double h) {
  for (std::size_t i = 0; i < detection_.points.size(); ++i) {
    if (approaches_.rebound[i] == 0) continue;
    ContactConstraint& c = rows_.contacts[i];
    double free_speed = 0;
    if (c.port_a >= 0) free_speed += c.J_a.row(0).dot(rows_.velocities.segment<6>(c.port_a));
    if (c.port_b >= 0) free_speed += c.J_b.row(0).dot(rows_.velocities.segment<6>(c.port_b));
    const double speed = ReboundSpeed(detection_.points[i].restitution, approaches_.rebound[i], free_speed,
                                      detection_.points[i].gap, h);
    if (speed > 0) c.bias[0] = -speed;
  }
}

}  // namespace fork1s
