// What the impulses of a step do to bodies, and what the next step has to know of them.
#include <algorithm>

#include "detail.hpp"

namespace fork1s {

// Wrenches side by side; what is left to one thread are sums, in the order of contacts.
void World::Detail::GatherPushes() {
  rows_.pushes.resize(detection_.points.size());
  ForContacts([&](std::size_t i) {
    const ContactConstraint& c = rows_.contacts[i];
    ConstraintRows::Push& push = rows_.pushes[i];
    push.any = !c.impulse.isZero(0);
    if (!push.any) return;
    push.body_a = detection_.points[i].body_a;
    push.body_b = detection_.points[i].body_b;
    push.port_a = c.port_a;
    push.port_b = c.port_b;
    if (c.port_a >= 0) push.on_a = c.ImpulseOn(c.J_a);
    if (c.port_b >= 0) push.on_b = c.ImpulseOn(c.J_b);
  });
  rows_.is_pushed.assign(detection_.contactors.size(), 0);
  const auto add = [&](int port, int contactor, const Vector6& F) {
    if (port < 0) return;
    const auto at = static_cast<std::size_t>(contactor);
    rows_.is_pushed[at] = 1;
    const Contactor& c = detection_.contactors[at];
    if (c.kind != Contactor::Kind::kGroup) return;
    PartRows& part = rows_.mechanisms[static_cast<std::size_t>(c.index)]
                         .parts[static_cast<std::size_t>(rows_.port_part[at])];
    part.impulse.segment<6>(port - part.offset) += F;
  };
  for (const ConstraintRows::Push& push : rows_.pushes) {
    if (!push.any) continue;
    add(push.port_a, push.body_a, push.on_a);
    add(push.port_b, push.body_b, push.on_b);
  }
}

void World::Detail::ApplyImpulses(bool of_bounded_forces) {
  bodies_.ForMechanisms([&](std::size_t i) {
    MechanismRows& block = rows_.mechanisms[i];
    for (PartRows& part : block.parts) part.impulse.head(part.size).setZero();
  });
  GatherPushes();
  if (of_bounded_forces)
    for (std::size_t k = 0; k < rows_.bounded_forces.size(); ++k) {
      const ConstraintRows::BoundedForce& force = rows_.bounded_forces[k];
      PartRows& part = rows_.mechanisms[force.mechanism].parts[force.part];
      part.impulse(part.BoundedForceRow(force.row_in_part)) = rows_.LimitOfBoundedForce(k).impulse;
    }
  for (std::size_t c = 0; c < detection_.contactors.size(); ++c)
    if (rows_.is_pushed[c] && detection_.contactors[c].kind == Contactor::Kind::kFreeBody)
      bodies_.free_bodies[static_cast<std::size_t>(detection_.contactors[c].index)].SetPortTwist(
          rows_.velocities.segment<6>(rows_.port_offset[c]));
  bodies_.ForMechanisms([&](std::size_t i) {
    MechanismRows& block = rows_.mechanisms[i];
    std::size_t next = block.first_limit;
    bool pushed = false;
    block.impulse.setZero();
    for (std::size_t p = 0; p < block.parts.size(); ++p) {
      PartRows& part = block.parts[p];
      for (std::size_t k = 0; k < part.limits.size(); ++k, ++next) {
        part.impulse(rows_.limits[next].row - part.offset) +=
            rows_.limits[next].sign * rows_.limits[next].impulse;
        stops_[i].impulses[static_cast<std::size_t>(part.limits[k])] = rows_.limits[next].impulse;
      }
      for (std::size_t k = 0; k < part.frictions.size(); ++k, ++next) {
        part.impulse(part.FrictionRow(k)) += rows_.limits[next].impulse;
        stops_[i].friction_impulses[static_cast<std::size_t>(part.frictions[k])] = rows_.limits[next].impulse;
      }
      if (part.size == 0 || part.J_T.rows() == 0) continue;
      const VelocityRange& run = bodies_.mechanisms[i].step_model().parts[p];
      block.impulse.segment(run.begin, run.size).noalias() =
          part.J_T.leftCols(part.size) * part.impulse.head(part.size);
      pushed = true;
    }
    if (pushed) ApplyImpulse(bodies_.mechanisms[i], block.impulse);
  });
}

void World::Detail::KeepForNextStep(double h, StepReport& report) {
  contacts_.resize(detection_.points.size());
  ForContacts([&](std::size_t i) {
    const ContactConstraint& c = rows_.contacts[i];
    contacts_[i].point = detection_.points[i];
    contacts_[i].impulse = c.impulse;
    contacts_[i].friction = c.friction;
    contacts_[i].moment = c.moment;
    contacts_[i].use = c.use;
    contacts_[i].end_force = c.impulse / h;
    contacts_[i].end_moment = c.moment / h;
    contacts_[i].end_speed = RelativeSpeed(c, rows_.velocities)(0);
  });
  for (const ContactRecord& c : contacts_)
    if (c.impulse(0) > 0) {
      ++report.contacts;
      report.max_penetration = std::max(report.max_penetration, -c.point.gap);
    }
  for (std::size_t k = 0; k + rows_.bounded_forces.size() < rows_.limits.size(); ++k) {
    const LimitConstraint& row = rows_.limits[k];
    const bool is_friction = row.lower < 0;
    report.limits += !is_friction && row.impulse > 0 ? 1 : 0;
  }
  for (const MechanismDynamics& m : bodies_.mechanisms) report.forces_at_bound += m.NumForcesAtBound();
}

}  // namespace fork1s
