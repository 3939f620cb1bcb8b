#include "ports.hpp"

#include <algorithm>
#include <cmath>

#include "stops.hpp"

namespace fork1s {
namespace {

// Room for every part of a mechanism; parts change only when its reference moves.
void SizeParts(const MechanismDynamics& m, MechanismRows& block) {
  const std::size_t count = m.step_model().parts.size() + 1;
  bool fits = block.parts.size() == count && block.impulse.size() == m.num_velocities();
  for (std::size_t p = 0; fits && p + 1 < count; ++p)
    fits = block.parts[p].J_T.rows() == m.step_model().parts[p].size;
  if (fits) return;
  block.impulse.resize(m.num_velocities());
  block.parts.assign(count, PartRows());
  std::vector<int> groups(count, 0), limits(count, 0), frictions(count, 0), bounded_forces(count, 0);
  for (std::size_t g = 0; g < m.groups().size(); ++g) {
    const int part = m.step_model().PartOfGroup(static_cast<int>(g));
    ++groups[part < 0 ? count - 1 : static_cast<std::size_t>(part)];
  }
  for (std::size_t k = 0; k < m.length_limits().size(); ++k)
    limits[static_cast<std::size_t>(m.step_model().part_of_limited[k])] += 2;
  for (std::size_t k = 0; k < m.mechanism().frictions().size(); ++k)
    ++frictions[static_cast<std::size_t>(m.step_model().part_of_friction[k])];
  for (const int part : m.step_model().part_of_bounded_force)
    if (part >= 0) ++bounded_forces[static_cast<std::size_t>(part)];
  for (std::size_t p = 0; p < count; ++p) {
    PartRows& part = block.parts[p];
    const int room = 6 * groups[p] + limits[p] + frictions[p] + bounded_forces[p],
              size = p + 1 < count ? m.step_model().parts[p].size : 0;
    part.groups.reserve(static_cast<std::size_t>(groups[p]));
    part.limits.reserve(static_cast<std::size_t>(limits[p]));
    part.frictions.reserve(static_cast<std::size_t>(frictions[p]));
    part.bounded_forces.reserve(static_cast<std::size_t>(bounded_forces[p]));
    part.room = bounded_forces[p];
    part.J_T.resize(size, room);
    part.Y.resize(size, room);
    part.impulse.resize(room);
  }
}

// Which stops and dry friction of a mechanism take part.
void LayOutLimits(const MechanismDynamics& m, const PortOptions& options, StopHistory& stops,
                  MechanismRows& block) {
  SizeParts(m, block);
  for (PartRows& part : block.parts) {
    part.groups.clear();
    part.limits.clear();
    part.frictions.clear();
    part.bounded_forces.clear();
  }
  // Loops may hold a mechanism on a fixed base altogether: then it has no part that stops or friction could
  // act in.
  const bool moves = !m.step_model().parts.empty();
  for (std::size_t k = 0; moves && k < m.mechanism().frictions().size(); ++k)
    block.parts[static_cast<std::size_t>(m.step_model().part_of_friction[k])].frictions.push_back(
        static_cast<int>(k));
  for (std::size_t k = 0; k < m.length_limits().size(); ++k) {
    const Mechanism::LengthLimit& limit = m.length_limits()[k];
    const double length = m.Length(limit.length);
    // Near enough to be reached within the step, with room for what contacts may add: 0.02 rad, or that share
    // of the mechanism's length.
    const double room = 0.02 * m.mechanism().length_scale() / MetersPerUnit(m, limit.length);
    const double reach = room + 2 * options.h * std::abs(LengthRate(m, limit.length));
    const double gap[2] = {length - limit.lower, limit.upper - length};
    for (int side = 0; side < 2; ++side) {
      const int at = static_cast<int>(2 * k) + side;
      stops.is_row[static_cast<std::size_t>(at)] = moves && (options.all_stops || gap[side] < reach);
      if (stops.is_row[static_cast<std::size_t>(at)])
        block.parts[static_cast<std::size_t>(m.step_model().part_of_limited[k])].limits.push_back(at);
      else
        stops.impulses[static_cast<std::size_t>(at)] = 0;
    }
  }
}

// Jᵀ of every part of a mechanism, and the twists of its groups at the start of the step.
void FillRows(const MechanismDynamics& m, const PortOptions& options, MechanismRows& block,
              ConstraintRows& rows) {
  for (std::size_t p = 0; p < block.parts.size(); ++p) {
    PartRows& part = block.parts[p];
    for (std::size_t g = 0; g < part.groups.size(); ++g) {
      const Eigen::Index column = 6 * static_cast<Eigen::Index>(g);
      GroupJacobian(m, part.groups[g], part.J_T.middleCols(column, 6));
      const auto J_T = part.J_T.middleCols(column, 6);
      rows.velocities.segment<6>(part.offset + column) = GroupTwist(m, part.groups[g], J_T);
      if (options.with_start_velocities)
        rows.start_velocities.segment<6>(part.offset + column) = GroupTwistAtStart(m, part.groups[g], J_T);
    }
    for (std::size_t k = 0; k < part.limits.size(); ++k) {
      LengthRow(m, m.length_limits()[static_cast<std::size_t>(part.limits[k] / 2)].length,
                m.step_model().parts[p], part.J_T.col(part.LimitRow(k)));
    }
    for (std::size_t k = 0; k < part.frictions.size(); ++k)
      LengthRow(m, m.mechanism().frictions()[static_cast<std::size_t>(part.frictions[k])].length,
                m.step_model().parts[p], part.J_T.col(part.FrictionRow(k)));
  }
}

// Units of the stacked velocities: the parts of all mechanisms, then collision bodies, of which free bodies count.
int NumParts(const ConstraintRows& rows) {
  std::size_t count = 0;
  for (const MechanismRows& block : rows.mechanisms) count += block.parts.size();
  return static_cast<int>(count);
}
int UnitOf(const Detection& detection, const ConstraintRows& rows, int collision_body) {
  const auto at = static_cast<std::size_t>(collision_body);
  const CollisionBody& c = detection.collision_bodies[at];
  if (c.kind == CollisionBody::Kind::kWorld) return -1;
  if (c.kind == CollisionBody::Kind::kFreeBody) return NumParts(rows) + collision_body;
  int unit = rows.port_part[at];
  for (int i = 0; i < c.index; ++i)
    unit += static_cast<int>(rows.mechanisms[static_cast<std::size_t>(i)].parts.size());
  return unit;
}

// What closures that act join.
void FindClosureGroups(const Detection& detection, const std::vector<SwitchedClosure>& closures,
                       ConstraintRows& rows) {
  std::vector<ClosureGroup>& groups = rows.closure_groups;
  std::size_t count = 0;
  const auto has = [](const std::vector<int>& units, int unit) {
    return unit >= 0 && std::find(units.begin(), units.end(), unit) != units.end();
  };
  for (const SwitchedClosure& closure : closures) {
    if (!closure.acts) continue;
    const int ends[] = {UnitOf(detection, rows, closure.a), UnitOf(detection, rows, closure.b)};
    // The first group that one of both is in takes in the others.
    std::size_t into = 0;
    while (into < count && !has(groups[into].units, ends[0]) && !has(groups[into].units, ends[1])) ++into;
    if (into == count) {
      if (count == groups.size()) groups.emplace_back();
      groups[count++].units.clear();
    }
    std::vector<int>& joined = groups[into].units;
    for (const int unit : ends)
      if (unit >= 0 && !has(joined, unit)) joined.push_back(unit);
    for (std::size_t g = into + 1; g < count;) {
      std::vector<int>& others = groups[g].units;
      if (!has(others, ends[0]) && !has(others, ends[1])) {
        ++g;
        continue;
      }
      for (const int unit : others)
        if (!has(joined, unit)) joined.push_back(unit);
      std::swap(others, groups[--count].units);
    }
  }
  groups.resize(count);
  for (ClosureGroup& group : groups) std::sort(group.units.begin(), group.units.end());
}

// Places in the stacked velocities, unit by unit; the units of a group of closures stand together, at the first.
void PlaceUnits(const Detection& detection, ConstraintRows& rows) {
  int offset = 0;
  const auto place_part = [&](PartRows& part) {
    part.offset = offset;
    part.size = static_cast<int>(6 * part.groups.size() + part.limits.size() + part.frictions.size());
    offset += part.size + part.room;
  };
  const auto place_body = [&](std::size_t collision_body) {
    rows.port_offset[collision_body] = offset;
    offset += 6;
  };
  const int num_parts = NumParts(rows);
  const auto place = [&](int unit) {
    if (unit >= num_parts) return place_body(static_cast<std::size_t>(unit - num_parts));
    std::size_t i = 0;
    for (; unit >= static_cast<int>(rows.mechanisms[i].parts.size()); ++i)
      unit -= static_cast<int>(rows.mechanisms[i].parts.size());
    place_part(rows.mechanisms[i].parts[static_cast<std::size_t>(unit)]);
  };
  // Whether a unit has its place as one of a group.
  const auto place_as_group = [&](int unit) {
    for (ClosureGroup& group : rows.closure_groups) {
      if (!std::binary_search(group.units.begin(), group.units.end(), unit)) continue;
      if (unit != group.units.front()) return true;
      group.begin = offset;
      for (const int member : group.units) place(member);
      group.end = offset;
      return true;
    }
    return false;
  };
  int unit = 0;
  for (MechanismRows& block : rows.mechanisms)
    for (PartRows& part : block.parts)
      if (!place_as_group(unit++)) place_part(part);
  for (std::size_t c = 0; c < detection.collision_bodies.size(); ++c)
    if (detection.collision_bodies[c].kind == CollisionBody::Kind::kFreeBody && rows.port_offset[c] >= 0 &&
        !place_as_group(num_parts + static_cast<int>(c)))
      place_body(c);
}

// Wrenches side by side; what is left to one thread are sums, in the order of contacts.
void GatherPushes(const Detection& detection, ConstraintRows& rows) {
  rows.pushes.resize(detection.points.size());
  ForContacts(detection, [&](std::size_t i) {
    const ContactConstraint& c = rows.contacts[i];
    ConstraintRows::Push& push = rows.pushes[i];
    const double pull = rows.PullOf(i);
    push.any = !c.impulse.isZero(0) || pull != 0;
    if (!push.any) return;
    push.body_a = detection.points[i].body_a;
    push.body_b = detection.points[i].body_b;
    push.port_a = c.port_a;
    push.port_b = c.port_b;
    if (c.port_a >= 0) push.on_a = c.ImpulseOn(c.J_a) - pull * c.J_a.row(0).transpose();
    if (c.port_b >= 0) push.on_b = c.ImpulseOn(c.J_b) - pull * c.J_b.row(0).transpose();
  });
  rows.is_pushed.assign(detection.collision_bodies.size(), 0);
  const auto add = [&](int port, int collision_body, const Vector6& F) {
    if (port < 0) return;
    const auto at = static_cast<std::size_t>(collision_body);
    rows.is_pushed[at] = 1;
    const CollisionBody& c = detection.collision_bodies[at];
    if (c.kind != CollisionBody::Kind::kGroup) return;
    PartRows& part = rows.mechanisms[static_cast<std::size_t>(c.index)]
                         .parts[static_cast<std::size_t>(rows.port_part[at])];
    part.impulse.segment<6>(port - part.offset) += F;
  };
  for (const ConstraintRows::Push& push : rows.pushes) {
    if (!push.any) continue;
    add(push.port_a, push.body_a, push.on_a);
    add(push.port_b, push.body_b, push.on_b);
  }
}

}  // namespace

// Which ports and limits take part, and where they stand in the stacked velocities. Fills Jᵀ of every part
// and, in rows.velocities, the twists at the start of the step.
void AssignPorts(const Bodies& bodies, const Detection& detection,
                 const std::vector<SwitchedClosure>& closures, const PortOptions& options,
                 std::vector<StopHistory>& stops, ConstraintRows& rows) {
  std::fill(rows.port_offset.begin(), rows.port_offset.end(), -1);
  const auto takes_part = [&](int side) {
    if (detection.collision_bodies[static_cast<std::size_t>(side)].kind != CollisionBody::Kind::kWorld)
      rows.port_offset[static_cast<std::size_t>(side)] = 0;
  };
  for (const ContactPoint& p : detection.points)
    for (const int side : {p.body_a, p.body_b}) takes_part(side);
  for (const SwitchedClosure& closure : closures)
    if (closure.acts)
      for (const int side : {closure.a, closure.b}) takes_part(side);

  bodies.ForMechanisms(
      [&](std::size_t i) { LayOutLimits(bodies.mechanisms[i], options, stops[i], rows.mechanisms[i]); });
  // Ports first get their place within their part, then the parts theirs.
  for (std::size_t c = 0; c < detection.collision_bodies.size(); ++c) {
    if (detection.collision_bodies[c].kind != CollisionBody::Kind::kGroup || rows.port_offset[c] < 0)
      continue;
    const auto i = static_cast<std::size_t>(detection.collision_bodies[c].index);
    auto& parts = rows.mechanisms[i].parts;
    const int part = bodies.mechanisms[i].step_model().PartOfGroup(detection.collision_bodies[c].group);
    rows.port_part[c] = part < 0 ? static_cast<int>(parts.size()) - 1 : part;
    auto& groups = parts[static_cast<std::size_t>(rows.port_part[c])].groups;
    rows.port_offset[c] = 6 * static_cast<int>(groups.size());
    groups.push_back(detection.collision_bodies[c].group);
  }
  FindClosureGroups(detection, closures, rows);
  PlaceUnits(detection, rows);
  bodies.ForMechanisms(
      [&](std::size_t i) { FillRows(bodies.mechanisms[i], options, rows.mechanisms[i], rows); });
  for (std::size_t c = 0; c < detection.collision_bodies.size(); ++c) {
    if (rows.port_offset[c] < 0) continue;
    const auto i = static_cast<std::size_t>(detection.collision_bodies[c].index);
    if (detection.collision_bodies[c].kind == CollisionBody::Kind::kGroup) {
      rows.port_offset[c] += rows.mechanisms[i].parts[static_cast<std::size_t>(rows.port_part[c])].offset;
    } else {
      rows.velocities.segment<6>(rows.port_offset[c]) = bodies.free_bodies[i].PortTwist();
      rows.start_velocities.segment<6>(rows.port_offset[c]) = bodies.free_bodies[i].StartPortTwist();
    }
  }
}

// After Predict: Y of every block, the free velocities, and the rows of contacts and limits.
void AssembleOperators(const Bodies& bodies, const Detection& detection, ConstraintRows& rows) {
  bodies.ForMechanisms([&](std::size_t i) {
    const MechanismDynamics& m = bodies.mechanisms[i];
    for (std::size_t p = 0; p < rows.mechanisms[i].parts.size(); ++p) {
      PartRows& part = rows.mechanisms[i].parts[p];
      if (part.size == 0) continue;
      if (p < m.step_model().parts.size()) {
        auto Y = part.Y.leftCols(part.size);
        Y = part.J_T.leftCols(part.size);
        HalfSolve(m, m.step_model().parts[p], Y);
      }
      for (std::size_t g = 0; g < part.groups.size(); ++g) {
        const Eigen::Index column = 6 * static_cast<Eigen::Index>(g);
        rows.velocities.segment<6>(part.offset + column) =
            GroupTwist(m, part.groups[g], part.J_T.middleCols(column, 6));
      }
      for (std::size_t k = 0; k < part.limits.size(); ++k)
        rows.velocities(part.offset + part.LimitRow(k)) =
            LengthRate(m, m.length_limits()[static_cast<std::size_t>(part.limits[k] / 2)].length);
      for (std::size_t k = 0; k < part.frictions.size(); ++k)
        rows.velocities(part.offset + part.FrictionRow(k)) =
            LengthRate(m, m.mechanism().frictions()[static_cast<std::size_t>(part.frictions[k])].length);
      for (std::size_t k = 0; k < part.bounded_forces.size(); ++k)
        rows.velocities(part.offset + part.BoundedForceRow(k)) =
            LengthRate(m, LengthOfBoundedForce(m, static_cast<std::size_t>(part.bounded_forces[k])));
    }
  });
  rows.blocks.clear();
  for (MechanismRows& block : rows.mechanisms)
    for (PartRows& part : block.parts)
      if (const int freedoms = static_cast<int>(part.Y.rows()); part.size > 0)
        rows.blocks.push_back({part.offset, part.size, part.Y.data(), freedoms, freedoms});
  for (std::size_t c = 0; c < detection.collision_bodies.size(); ++c)
    if (detection.collision_bodies[c].kind == CollisionBody::Kind::kFreeBody && rows.port_offset[c] >= 0) {
      const auto b = static_cast<std::size_t>(detection.collision_bodies[c].index);
      rows.velocities.segment<6>(rows.port_offset[c]) = bodies.free_bodies[b].PortTwist();
      rows.free_Y[b] = bodies.free_bodies[b].InverseInertiaRoot();
      rows.blocks.push_back({rows.port_offset[c], 6, rows.free_Y[b].data(), 6, 6});
    }
}

// The frames that the twists of ports are given in and about: of mechanisms their root, of free bodies world
// axes at their centre of mass. Every contact asks for those of its two sides several times.
void FindPortFrames(const Bodies& bodies, const Detection& detection, ConstraintRows& rows) {
  rows.port_frames.resize(detection.collision_bodies.size());
  for (std::size_t c = 0; c < detection.collision_bodies.size(); ++c) {
    if (rows.port_offset[c] < 0) continue;
    const auto i = static_cast<std::size_t>(detection.collision_bodies[c].index);
    rows.port_frames[c] = detection.collision_bodies[c].kind == CollisionBody::Kind::kFreeBody
                              ? RigidTransform(Matrix3::Identity(), bodies.free_bodies[i].center_W())
                              : bodies.mechanisms[i].state().X_WR;
  }
}

// Rows of the contact frame on the twist of a port.
Matrix36 PortRows(const Detection& detection, const ConstraintRows& rows, int collision_body,
                  const Vector3& point, const Matrix3& frame) {
  const auto c = static_cast<std::size_t>(collision_body);
  const RigidTransform& X_WP = rows.port_frames[c];
  Vector3 p = point - X_WP.translation();
  Matrix36 J;
  if (detection.collision_bodies[c].kind == CollisionBody::Kind::kFreeBody) {  // in world axes
    J.rightCols<3>() = frame;
  } else {
    p = X_WP.rotation().transpose().lazyProduct(p).eval();
    J.rightCols<3>() = frame.lazyProduct(X_WP.rotation());
  }
  for (int k = 0; k < 3; ++k)
    J.row(k).head<3>() = p.cross(Vector3(J.row(k).tail<3>().transpose())).transpose();
  return J;
}

void ApplyImpulses(const Detection& detection, const std::vector<SwitchedClosure>& closures,
                   bool of_bounded_forces, Bodies& bodies, std::vector<StopHistory>& stops,
                   ConstraintRows& rows) {
  bodies.ForMechanisms([&](std::size_t i) {
    MechanismRows& block = rows.mechanisms[i];
    for (PartRows& part : block.parts) part.impulse.head(part.size).setZero();
  });
  GatherPushes(detection, rows);
  GatherClosureImpulses(closures, detection, rows);
  if (of_bounded_forces)
    for (std::size_t k = 0; k < rows.bounded_forces.size(); ++k) {
      const ConstraintRows::BoundedForce& force = rows.bounded_forces[k];
      PartRows& part = rows.mechanisms[force.mechanism].parts[force.part];
      part.impulse(part.BoundedForceRow(force.row_in_part)) = rows.LimitOfBoundedForce(k).impulse;
    }
  for (std::size_t c = 0; c < detection.collision_bodies.size(); ++c)
    if (rows.is_pushed[c] && detection.collision_bodies[c].kind == CollisionBody::Kind::kFreeBody)
      bodies.free_bodies[static_cast<std::size_t>(detection.collision_bodies[c].index)].SetPortTwist(
          rows.velocities.segment<6>(rows.port_offset[c]));
  bodies.ForMechanisms([&](std::size_t i) {
    MechanismRows& block = rows.mechanisms[i];
    std::size_t next = block.first_limit;
    bool pushed = false;
    block.impulse.setZero();
    for (std::size_t p = 0; p < block.parts.size(); ++p) {
      PartRows& part = block.parts[p];
      for (std::size_t k = 0; k < part.limits.size(); ++k, ++next) {
        part.impulse(rows.limits[next].row - part.offset) +=
            rows.limits[next].sign * rows.limits[next].impulse;
        stops[i].impulses[static_cast<std::size_t>(part.limits[k])] = rows.limits[next].impulse;
      }
      for (std::size_t k = 0; k < part.frictions.size(); ++k, ++next) {
        part.impulse(part.FrictionRow(k)) += rows.limits[next].impulse;
        stops[i].friction_impulses[static_cast<std::size_t>(part.frictions[k])] = rows.limits[next].impulse;
      }
      if (part.size == 0 || part.J_T.rows() == 0) continue;
      const VelocityRange& run = bodies.mechanisms[i].step_model().parts[p];
      block.impulse.segment(run.begin, run.size).noalias() =
          part.J_T.leftCols(part.size) * part.impulse.head(part.size);
      pushed = true;
    }
    if (pushed) ApplyImpulse(bodies.mechanisms[i], block.impulse);
  });
}

}  // namespace fork1s
