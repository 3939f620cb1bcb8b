#include "error_contact_loads.hpp"

#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <limits>

namespace fork1s {

ContactLoads LoadsOf(const World& world, const std::vector<ContactRecord>& contacts, double h) {
  ContactLoads loads;
  for (const MechanismDynamics& m : world.mechanisms())
    loads.mechanisms.push_back(Matrix6X::Zero(6, m.mechanism().num_bodies()));
  loads.free_bodies.assign(world.free_bodies().size(), Vector6::Zero());
  for (const ContactRecord& c : contacts) {
    const Vector3 f = c.point.frame.transpose() * c.impulse / h;
    Vector6 F;
    F << c.point.point.cross(f) + Vector3(c.point.frame.transpose() * c.moment / h), f;
    for (const auto& [body, sign] : {std::pair(c.point.body_a, -1.0), std::pair(c.point.body_b, 1.0)}) {
      const Contactor& side = world.contactors()[static_cast<std::size_t>(body)];
      const auto at = static_cast<std::size_t>(side.index);
      if (side.kind == Contactor::Kind::kGroup)
        loads.mechanisms[at].col(
            world.mechanisms()[at].groups()[static_cast<std::size_t>(side.group)].body.value()) += sign * F;
      else if (side.kind == Contactor::Kind::kFreeBody)
        loads.free_bodies[at] += sign * F;
    }
  }
  return loads;
}

std::vector<ContactRecord> MovedTo(const std::vector<ContactPoint>& points,
                                   std::vector<ContactRecord> contacts) {
  std::vector<char> taken(points.size(), 0);
  for (ContactRecord& c : contacts) {
    std::size_t best = points.size();
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const ContactPoint& p = points[i];
      if (taken[i] || p.body_a != c.point.body_a || p.body_b != c.point.body_b ||
          p.geometry_a != c.point.geometry_a || p.geometry_b != c.point.geometry_b)
        continue;
      const double distance = (p.point - c.point.point).norm();
      if (distance < nearest) {
        nearest = distance;
        best = i;
      }
    }
    if (best == points.size()) continue;
    taken[best] = 1;
    c.point.point = points[best].point;
  }
  return contacts;
}

}  // namespace fork1s
