#include "assembly.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "ports.hpp"

namespace fork1s {
namespace {

// The rows of a contact, and what they know of the last step.
void AssembleContact(std::size_t i, const StageAtHand& stage, const StepOptions& options,
                     const ContactHistory& history, Detection& detection, Approaches& approaches,
                     ConstraintRows& rows) {
  const double h = options.h;
  ContactPoint& p = detection.points[i];
  ContactConstraint& c = rows.contacts[i];
  c = ContactConstraint{};
  c.friction = p.friction;
  c.torsion = p.torsion;
  c.rolling = p.rolling;
  c.friction_scale = p.friction_scale;
  c.spin = p.surface_velocity[0];
  const CollisionBody& a = detection.collision_bodies[static_cast<std::size_t>(p.body_a)];
  const CollisionBody& b = detection.collision_bodies[static_cast<std::size_t>(p.body_b)];
  if (a.kind != CollisionBody::Kind::kWorld) c.port_a = rows.port_offset[static_cast<std::size_t>(p.body_a)];
  if (b.kind != CollisionBody::Kind::kWorld) c.port_b = rows.port_offset[static_cast<std::size_t>(p.body_b)];
  if (c.port_a >= 0) c.J_a = -PortRows(detection, rows, p.body_a, p.point, p.frame);
  if (c.port_b >= 0) c.J_b = PortRows(detection, rows, p.body_b, p.point, p.frame);
  const Vector3 speed = RelativeSpeed(c, rows.velocities);
  // A stage finds contacts at the pose that the velocity at hand leads to: this is the gap at its base point.
  if (!stage.keeps_contacts) {
    approaches.pose_gaps[i] = p.gap;
    if (stage.within) p.gap -= h * speed(0);
  }
  approaches.closing[i] =
      std::max(0.0, -(stage.rows_from_start ? RelativeSpeed(c, rows.start_velocities) : speed)(0));
  if (const double start_gap = history.StartGap(i); start_gap <= 0) p.gap = start_gap;
  SetMaterial(options.material, p.gap, h, c);
  c.bias.tail<2>() = p.surface_velocity.tail<2>();
  // Of the two stages restitution would be extrapolated; a step that meets something that has it is halved. A
  // stage of backward Euler takes the approach from the velocity of its start, by the rows of its end.
  if (p.restitution > 0 && stage.within && stage.is_backward_euler)
    approaches.rebound[i] = std::max(0.0, -RelativeSpeed(c, rows.start_velocities)(0));
  // A body on the floor would fall upon all that is near, were nothing there to hold it: it goes on as it
  // did. What is open at the pose at hand most likely stays so.
  c.may_be_deferred = p.gap + h * speed(0) > 0;
  if (!history.Before(i)) return;
  const ContactRecord& before = *history.Before(i);
  c.may_be_deferred = c.may_be_deferred && before.impulse.isZero(0);
  // Surfaces bear a force; impulses are those of a step, the mean of both stages.
  const Matrix3 turned = p.frame * before.point.frame.transpose();
  const Vector6& onward = history.to_base_point[static_cast<std::size_t>(history.match[i])];
  c.previous_impulse = c.impulse = h * (turned * (before.end_force + onward.tail<3>()));
  c.previous_utilization = before.utilization;
  c.previous_moment = c.moment = h * (turned * (before.end_moment + onward.head<3>()));
}

void FillStops(std::size_t i, const MechanismDynamics& m, const StageAtHand& stage,
               const StepOptions& options, const StopHistory& stops, Approaches& approaches,
               ConstraintRows& rows) {
  const double h = options.h;
  auto next = rows.limits.begin() + static_cast<std::ptrdiff_t>(rows.mechanisms[i].first_limit);
  for (const PartRows& part : rows.mechanisms[i].parts) {
    for (std::size_t k = 0; k < part.limits.size(); ++k) {
      const auto at = static_cast<std::size_t>(part.limits[k]);
      const Mechanism::LengthLimit& stop = m.length_limits()[at / 2];
      const bool upper = at % 2 == 1;
      const double length = m.Length(stop.length);
      LimitConstraint& limit = *next++;
      limit.row = part.offset + static_cast<int>(part.LimitRow(k));
      limit.sign = upper ? -1 : 1;
      const double moved = stage.within ? h * LengthRate(m, stop.length) : 0;
      const double gap = upper ? stop.upper - length + moved : length - moved - stop.lower;
      limit.bias = stage.within && stops.start_gap[at] <= 0
                       ? StopBias(options.material, stops.start_gap[at], h)
                       : StopBias(options.material, gap, h);
      limit.impulse = stops.impulses[at];
      // One that bore may have only closed its gap: what of the speed is left counts there too.
      if (stage.within) {
        StopApproach& approach = approaches.stops[static_cast<std::size_t>(&limit - rows.limits.data())];
        approach = ApproachOf(m, stop, upper, stage.rows_from_start);
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
      friction.previous_impulse = stops.friction_held[at];
      friction.impulse = stops.friction_impulses[at];
    }
  }
}

}  // namespace

void StartStops(double steps_ratio, std::vector<StopHistory>& all) {
  for (StopHistory& stops : all) {
    for (std::vector<double>* impulses : {&stops.impulses, &stops.friction_impulses})
      for (double& impulse : *impulses) impulse *= steps_ratio;
    stops.friction_held = stops.friction_impulses;
  }
}

void AssembleContacts(const StageAtHand& stage, const StepOptions& options, const ContactHistory& history,
                      Detection& detection, Approaches& approaches, ConstraintRows& rows) {
  rows.contacts.resize(detection.points.size());
  approaches.rebound.assign(detection.points.size(), 0.0);
  approaches.closing.assign(detection.points.size(), 0.0);
  approaches.pose_gaps.resize(detection.points.size());
  ForContacts(detection, [&](std::size_t i) {
    AssembleContact(i, stage, options, history, detection, approaches, rows);
  });
}

// Every mechanism's rows have their place before they are known, so that mechanisms fill them side by side.
void AssembleStops(const Bodies& bodies, const StageAtHand& stage, const StepOptions& options,
                   const std::vector<StopHistory>& stops, Approaches& approaches, ConstraintRows& rows) {
  std::size_t count = 0;
  for (MechanismRows& block : rows.mechanisms) {
    block.first_limit = count;
    for (const PartRows& part : block.parts) count += part.limits.size() + part.frictions.size();
  }
  rows.limits.assign(count, LimitConstraint());
  approaches.stops.assign(count, StopApproach());
  rows.bounded_forces.clear();
  bodies.ForMechanisms(
      [&](std::size_t i) { FillStops(i, bodies.mechanisms[i], stage, options, stops[i], approaches, rows); });
}

// A tendon that is shortest where it is still too long has a row that vanishes there, and so has the stop of a joint that
// a loop drives through a dead centre: at any speed that it recovers at, the joints run ever faster towards that pose and
// past it. A push by at most the momentum of the whole mechanism at that speed ends there, as the speed falls with the
// inverse mass of the row.
void BoundRecoveryMomentum(const Bodies& bodies, ConstraintRows& rows) {
  for (std::size_t i = 0; i < bodies.mechanisms.size(); ++i) {
    const MechanismDynamics& m = bodies.mechanisms[i];
    std::size_t next = rows.mechanisms[i].first_limit;
    for (const PartRows& part : rows.mechanisms[i].parts) {
      for (std::size_t k = 0; k < part.limits.size(); ++k) {
        LimitConstraint& limit = rows.limits[next++];
        const auto at = static_cast<std::size_t>(part.limits[k] / 2);
        const Mechanism::Length& length = m.length_limits()[at].length;
        if (!(limit.bias < 0) || part.Y.rows() == 0) continue;
        const double per_meter =
                         (m.mechanism().IsTendon(length) ? length.gear : 1) / MetersPerUnit(m, length),
                     inverse_mass = part.Y.col(part.LimitRow(k)).squaredNorm() / (per_meter * per_meter);
        limit.bias *= std::min(1.0, m.mechanism().total_mass() * inverse_mass);
      }
      next += part.frictions.size();
    }
  }
}

void Rebound(const Detection& detection, const Approaches& approaches, double h, ConstraintRows& rows) {
  for (std::size_t i = 0; i < detection.points.size(); ++i) {
    if (approaches.rebound[i] == 0) continue;
    ContactConstraint& c = rows.contacts[i];
    const double speed = ReboundSpeed(detection.points[i].restitution, approaches.rebound[i],
                                      RelativeSpeed(c, rows.velocities)(0), detection.points[i].gap, h);
    if (speed > 0) c.bias[0] = -speed;
  }
}

// Linearized at the pose of a stage, the gap of a contact, stop or tendon that lasts would come back as an
// error of position: of first order, as the gap bends. By the gap at the start of the step, gap/(h + τ) of a
// stage is stable for τ above 0.71 of its length.
//
// A stage of backward Euler that closes a gap leaves the velocity of the chord; what it stops is stopped in
// the next one, along the rows of its end. Where a length that a stop holds bends, as a taut string does that
// swings, that velocity runs on into the stop by half of what the stop's force changes in the stage. What
// closes slower than by all that it has changed in the last step, or part of one, is borne.
void RecordStops(Bodies& bodies, const StageAtHand& stage, double impact_speed,
                 std::vector<StopHistory>& all) {
  for (std::size_t i = 0; i < bodies.mechanisms.size(); ++i) {
    StopHistory& stops = all[i];
    for (std::size_t at = 0; at < stops.impulses.size(); ++at) {
      stops.carried[at] = stops.is_fresh[at] = 0;
      stops.start_gap[at] = std::numeric_limits<double>::quiet_NaN();
      if (!(stops.impulses[at] > 0)) continue;
      const Mechanism::LengthLimit& stop = bodies.mechanisms[i].length_limits()[at / 2];
      const StopApproach a = ApproachOf(bodies.mechanisms[i], stop, at % 2 == 1, stage.rows_from_start);
      const auto turned = [&] {
        return a.scale * stops.impulses[at] * RatePerImpulse(bodies.mechanisms[i], stop.length);
      };
      if (!stage.is_backward_euler && !(a.speed < impact_speed) && !(a.speed < turned())) continue;
      stops.carried[at] = 1;
      stops.is_fresh[at] = a.speed > kPartingRate * a.size;
      stops.start_gap[at] = a.gap / a.scale;
    }
  }
}

}  // namespace fork1s
