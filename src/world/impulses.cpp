// What the impulses of a step do to bodies, and what the next step has to know of them.
#include <algorithm>

#include "detail.hpp"

namespace fork1s {

// Wrenches side by side; what is left to one thread are sums, in the order of contacts.
void World::Detail::GatherPushes() {
  pushes_.resize(points_.size());
  ForContacts([&](std::size_t i) {
    const ContactConstraint& c = constraints_[i];
    Push& push = pushes_[i];
    push.any = !c.impulse.isZero(0);
    if (!push.any) return;
    push.body_a = points_[i].body_a;
    push.body_b = points_[i].body_b;
    push.port_a = c.port_a;
    push.port_b = c.port_b;
    if (c.port_a >= 0) push.on_a = c.ImpulseOn(c.J_a);
    if (c.port_b >= 0) push.on_b = c.ImpulseOn(c.J_b);
  });
  is_pushed_.assign(contactors_.size(), 0);
  const auto add = [&](int port, int contactor, const Vector6& F) {
    if (port < 0) return;
    const auto at = static_cast<std::size_t>(contactor);
    is_pushed_[at] = 1;
    const Contactor& c = contactors_[at];
    if (c.kind != Contactor::Kind::kGroup) return;
    PartBlock& part =
        mechanism_blocks_[static_cast<std::size_t>(c.index)].parts[static_cast<std::size_t>(port_part_[at])];
    part.port_impulse.segment<6>(port - part.offset) += F;
  };
  for (const Push& push : pushes_) {
    if (!push.any) continue;
    add(push.port_a, push.body_a, push.on_a);
    add(push.port_b, push.body_b, push.on_b);
  }
}

void World::Detail::ApplyImpulses(bool of_bounded_forces) {
  ForMechanisms([&](std::size_t i) {
    MechanismBlock& block = mechanism_blocks_[i];
    for (PartBlock& part : block.parts) part.port_impulse.head(part.rows).setZero();
  });
  GatherPushes();
  if (of_bounded_forces)
    for (std::size_t k = 0; k < bounded_forces_.size(); ++k) {
      const BoundedForceInSolve& force = bounded_forces_[k];
      PartBlock& part = mechanism_blocks_[force.mechanism].parts[force.part];
      part.port_impulse(part.BoundedForceRow(force.row_in_part)) =
          limits_[limits_.size() - bounded_forces_.size() + k].impulse;
    }
  for (std::size_t c = 0; c < contactors_.size(); ++c)
    if (is_pushed_[c] && contactors_[c].kind == Contactor::Kind::kFreeBody)
      free_bodies_[static_cast<std::size_t>(contactors_[c].index)].SetPortTwist(
          velocities_.segment<6>(port_offset_[c]));
  ForMechanisms([&](std::size_t i) {
    MechanismBlock& block = mechanism_blocks_[i];
    std::size_t next = block.first_limit;
    bool pushed = false;
    block.impulse.setZero();
    for (std::size_t p = 0; p < block.parts.size(); ++p) {
      PartBlock& part = block.parts[p];
      for (std::size_t k = 0; k < part.limits.size(); ++k, ++next) {
        part.port_impulse(limits_[next].row - part.offset) += limits_[next].sign * limits_[next].impulse;
        block.limit_impulses[static_cast<std::size_t>(part.limits[k])] = limits_[next].impulse;
      }
      for (std::size_t k = 0; k < part.frictions.size(); ++k, ++next) {
        part.port_impulse(part.FrictionRow(k)) += limits_[next].impulse;
        block.friction_impulses[static_cast<std::size_t>(part.frictions[k])] = limits_[next].impulse;
      }
      if (part.rows == 0 || part.J_T.rows() == 0) continue;
      const VelocityRange& run = mechanisms_[i].step_model().parts[p];
      block.impulse.segment(run.begin, run.size).noalias() =
          part.J_T.leftCols(part.rows) * part.port_impulse.head(part.rows);
      pushed = true;
    }
    if (pushed) ApplyImpulse(mechanisms_[i], block.impulse);
  });
}

void World::Detail::KeepForNextStep(double h, StepReport& report) {
  contacts_.resize(points_.size());
  ForContacts([&](std::size_t i) {
    const ContactConstraint& c = constraints_[i];
    contacts_[i].point = points_[i];
    contacts_[i].impulse = c.impulse;
    contacts_[i].friction = c.friction;
    contacts_[i].moment = c.moment;
    contacts_[i].use = c.use;
    contacts_[i].end_force = c.impulse / h;
    contacts_[i].end_moment = c.moment / h;
    contacts_[i].end_speed = RelativeSpeed(c, velocities_)(0);
  });
  for (const ContactRecord& c : contacts_)
    if (c.impulse(0) > 0) {
      ++report.contacts;
      report.max_penetration = std::max(report.max_penetration, -c.point.gap);
    }
  for (std::size_t k = 0; k + bounded_forces_.size() < limits_.size(); ++k) {
    const LimitConstraint& row = limits_[k];
    const bool is_friction = row.lower < 0;
    report.limits += !is_friction && row.impulse > 0 ? 1 : 0;
  }
  for (const MechanismDynamics& m : mechanisms_) report.forces_at_bound += m.NumForcesAtBound();
}

}  // namespace fork1s
