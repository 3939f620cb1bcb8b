// The rows of contacts and stops.
#include <algorithm>
#include <cmath>
#include <limits>

#include "detail.hpp"

namespace fork1s {
namespace {

constexpr double kNoGap = std::numeric_limits<double>::quiet_NaN();

}  // namespace

// The frames that the twists of ports are given in and about: of mechanisms their root, of free bodies world
// axes at their centre of mass. Every contact asks for those of its two sides several times.
void World::Detail::FindPortFrames() {
  rows_.port_frames.resize(detection_.contactors.size());
  for (std::size_t c = 0; c < detection_.contactors.size(); ++c) {
    if (rows_.port_offset[c] < 0) continue;
    const auto i = static_cast<std::size_t>(detection_.contactors[c].index);
    rows_.port_frames[c] = detection_.contactors[c].kind == Contactor::Kind::kFreeBody
                               ? RigidTransform(Matrix3::Identity(), bodies_.free_bodies[i].center_W())
                               : bodies_.mechanisms[i].state().X_WR;
  }
}

// Rows of the contact frame on the twist of a port.
Matrix36 World::Detail::PortRows(int contactor, const Vector3& point, const Matrix3& frame) const {
  const auto c = static_cast<std::size_t>(contactor);
  const RigidTransform& X_WP = rows_.port_frames[c];
  Vector3 p = point - X_WP.translation();
  Matrix36 J;
  if (detection_.contactors[c].kind == Contactor::Kind::kFreeBody) {  // in world axes
    J.rightCols<3>() = frame;
  } else {
    p = X_WP.rotation().transpose().lazyProduct(p).eval();
    J.rightCols<3>() = frame.lazyProduct(X_WP.rotation());
  }
  for (int k = 0; k < 3; ++k)
    J.row(k).head<3>() = p.cross(Vector3(J.row(k).tail<3>().transpose())).transpose();
  return J;
}

void StopHistory::Resize(std::size_t limits, std::size_t frictions) {
  for (std::vector<double>* values : {&impulses, &start_gap}) values->assign(limits, 0.0);
  for (std::vector<char>* flags : {&carried, &is_fresh, &is_row}) flags->assign(limits, 0);
  for (std::vector<double>* values : {&friction_impulses, &friction_held}) values->assign(frictions, 0.0);
}

// What turns an impulse of the last step into one of this step.
double World::Detail::StepsRatio(double h) const { return previous_h_ > 0 ? h / previous_h_ : 1; }

// Stops and dry friction in a stage of length b start from the forces that they bore in the last one.
void World::Detail::StartRows(double b) {
  const double by_step = StepsRatio(b);
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
  if (c.port_a >= 0) c.J_a = -PortRows(p.body_a, p.point, p.frame);
  if (c.port_b >= 0) c.J_b = PortRows(p.body_b, p.point, p.frame);
  const Vector3 speed = RelativeSpeed(c, rows_.velocities);
  // A stage finds contacts at the pose that the velocity at hand leads to: this is the gap at its base point.
  if (in_stage_) p.gap -= h * speed(0);
  closing_[i] = std::max(0.0, -(from_stage_start_ ? RelativeSpeed(c, rows_.start_velocities) : speed)(0));
  if (const double start_gap = StartGap(i); start_gap <= 0) p.gap = start_gap;
  SetMaterial(options.material, p.gap, h, c);
  // Of the two stages restitution would be extrapolated; a step that meets something that has it is halved. A stage of
  // backward Euler takes the approach from the velocity of its start, by the rows of its end.
  if (p.restitution > 0 && in_stage_ && is_backward_euler_)
    approach_[i] = std::max(0.0, -RelativeSpeed(c, rows_.start_velocities)(0));
  // A body on the floor would fall upon all that is near, were nothing there to hold it: it goes on as it
  // did.
  c.waits = p.gap + h * speed(0) > kClearShare * detection_.shapes.PairSize(p);
  if (match_[i] < 0) return;
  const auto k = static_cast<std::size_t>(match_[i]);
  const ContactRecord& before = previous_[k];
  c.waits = c.waits && before.impulse.isZero(0);
  // Surfaces bear a force; impulses are those of a step, the mean of both stages.
  const Matrix3 turned = p.frame * before.point.frame.transpose();
  const Vector6& onward = to_base_point_[k];
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
      stops.start_gap[at] = kNoGap;
      if (!(stops.impulses[at] > 0)) continue;
      const Mechanism::LengthLimit& stop = bodies_.mechanisms[i].length_limits()[at / 2];
      const StopApproach a = ApproachOf(bodies_.mechanisms[i], stop, at % 2 == 1);
      const auto turned = [&] {
        return a.scale * stops.impulses[at] * RatePerImpulse(bodies_.mechanisms[i], stop.length);
      };
      if (!is_backward_euler_ && !(a.speed < impact_speed_) && !(a.speed < turned())) continue;
      stops.carried[at] = 1;
      stops.is_fresh[at] = h * a.speed > kPartingShare * a.size;
      stops.start_gap[at] = a.gap / a.scale;
    }
  }
}

// Contacts are those found at the start.
void World::Detail::RecordStartGaps() {
  for (std::size_t i = 0; i < detection_.points.size(); ++i)
    if (Bore(i)) start_gap_[static_cast<std::size_t>(match_[i])] = detection_.points[i].gap;
}

// After the first stage, whose contacts become previous_.
void World::Detail::CarryStartGaps() {
  next_start_gap_.resize(detection_.points.size());
  for (std::size_t i = 0; i < detection_.points.size(); ++i) next_start_gap_[i] = StartGap(i);
  start_gap_.swap(next_start_gap_);
}

// m; NaN where a contact carried no load at the start of the step at hand.
double World::Detail::StartGap(std::size_t contact) const {
  if (!in_stage_ || match_[contact] < 0) return kNoGap;
  return start_gap_[static_cast<std::size_t>(match_[contact])];
}

void World::Detail::AssembleConstraints(const StepOptions& options) {
  rows_.contacts.resize(detection_.points.size());
  approach_.assign(detection_.points.size(), 0.0);
  closing_.assign(detection_.points.size(), 0.0);
  FindPortFrames();
  ForContacts([&](std::size_t i) { AssembleContact(i, options); });
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
  stop_approach_.assign(count, StopApproach());
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
        StopApproach& approach = stop_approach_[static_cast<std::size_t>(&limit - rows_.limits.data())];
        approach = ApproachOf(m, stop, upper);
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
    if (approach_[i] == 0) continue;
    ContactConstraint& c = rows_.contacts[i];
    double free_speed = 0;
    if (c.port_a >= 0) free_speed += c.J_a.row(0).dot(rows_.velocities.segment<6>(c.port_a));
    if (c.port_b >= 0) free_speed += c.J_b.row(0).dot(rows_.velocities.segment<6>(c.port_b));
    const double speed =
        ReboundSpeed(detection_.points[i].restitution, approach_[i], free_speed, detection_.points[i].gap, h);
    if (speed > 0) c.bias[0] = -speed;
  }
}

}  // namespace fork1s
