#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>

#include "detail.hpp"

namespace fork1s {

// Room for every part of a mechanism; parts change only when its reference moves.
void World::Detail::SizeBlocks(std::size_t mechanism) {
  const MechanismDynamics& m = bodies_.mechanisms[mechanism];
  MechanismRows& block = rows_.mechanisms[mechanism];
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
void World::Detail::LayOutLimits(std::size_t i, const StepOptions& options) {
  const MechanismDynamics& m = bodies_.mechanisms[i];
  MechanismRows& block = rows_.mechanisms[i];
  StopHistory& stops = stops_[i];
  SizeBlocks(i);
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
      stops.is_row[static_cast<std::size_t>(at)] = moves && (all_stops_ || gap[side] < reach);
      if (stops.is_row[static_cast<std::size_t>(at)])
        block.parts[static_cast<std::size_t>(m.step_model().part_of_limited[k])].limits.push_back(at);
      else
        stops.impulses[static_cast<std::size_t>(at)] = 0;
    }
  }
}

// Jᵀ of every part of a mechanism, and the twists of its groups at the start of the step.
void World::Detail::FillRows(std::size_t i) {
  const MechanismDynamics& m = bodies_.mechanisms[i];
  const bool at_start = in_stage_ && (is_backward_euler_ || from_stage_start_);
  for (std::size_t p = 0; p < rows_.mechanisms[i].parts.size(); ++p) {
    PartRows& part = rows_.mechanisms[i].parts[p];
    for (std::size_t g = 0; g < part.groups.size(); ++g) {
      const Eigen::Index column = 6 * static_cast<Eigen::Index>(g);
      GroupJacobian(m, part.groups[g], part.J_T.middleCols(column, 6));
      const auto J_T = part.J_T.middleCols(column, 6);
      rows_.velocities.segment<6>(part.offset + column) = GroupTwist(m, part.groups[g], J_T);
      if (at_start)
        rows_.start_velocities.segment<6>(part.offset + column) = GroupTwistAtStart(m, part.groups[g], J_T);
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

// Which ports and limits take part, and where they stand in the stacked velocities. Fills Jᵀ of every part
// and, in rows_.velocities, the twists at the start of the step.
void World::Detail::LayOutPorts(const StepOptions& options) {
  std::fill(rows_.port_offset.begin(), rows_.port_offset.end(), -1);
  for (const ContactPoint& p : detection_.points)
    for (int side : {p.body_a, p.body_b})
      if (detection_.contactors[static_cast<std::size_t>(side)].kind != Contactor::Kind::kWorld)
        rows_.port_offset[static_cast<std::size_t>(side)] = 0;

  bodies_.ForMechanisms([&](std::size_t i) { LayOutLimits(i, options); });
  // Ports first get their place within their part, then the parts theirs.
  for (std::size_t c = 0; c < detection_.contactors.size(); ++c) {
    if (detection_.contactors[c].kind != Contactor::Kind::kGroup || rows_.port_offset[c] < 0) continue;
    const auto i = static_cast<std::size_t>(detection_.contactors[c].index);
    auto& parts = rows_.mechanisms[i].parts;
    const int part = bodies_.mechanisms[i].step_model().PartOfGroup(detection_.contactors[c].group);
    rows_.port_part[c] = part < 0 ? static_cast<int>(parts.size()) - 1 : part;
    auto& groups = parts[static_cast<std::size_t>(rows_.port_part[c])].groups;
    rows_.port_offset[c] = 6 * static_cast<int>(groups.size());
    groups.push_back(detection_.contactors[c].group);
  }
  int offset = 0;
  for (MechanismRows& block : rows_.mechanisms)
    for (PartRows& part : block.parts) {
      part.offset = offset;
      part.size = static_cast<int>(6 * part.groups.size() + part.limits.size() + part.frictions.size());
      offset += part.size + part.room;
    }
  bodies_.ForMechanisms([&](std::size_t i) { FillRows(i); });
  for (std::size_t c = 0; c < detection_.contactors.size(); ++c) {
    if (rows_.port_offset[c] < 0) continue;
    const auto i = static_cast<std::size_t>(detection_.contactors[c].index);
    if (detection_.contactors[c].kind == Contactor::Kind::kGroup) {
      rows_.port_offset[c] += rows_.mechanisms[i].parts[static_cast<std::size_t>(rows_.port_part[c])].offset;
    } else {
      rows_.port_offset[c] = offset;
      rows_.velocities.segment<6>(offset) = bodies_.free_bodies[i].PortTwist();
      rows_.start_velocities.segment<6>(offset) = bodies_.free_bodies[i].StartPortTwist();
      offset += 6;
    }
  }
}

// After Predict: Y of every block, the free velocities, and the rows of contacts and limits.
void World::Detail::AssembleOperators() {
  bodies_.ForMechanisms([&](std::size_t i) {
    const MechanismDynamics& m = bodies_.mechanisms[i];
    for (std::size_t p = 0; p < rows_.mechanisms[i].parts.size(); ++p) {
      PartRows& part = rows_.mechanisms[i].parts[p];
      if (part.size == 0) continue;
      if (p < m.step_model().parts.size()) {
        auto Y = part.Y.leftCols(part.size);
        Y = part.J_T.leftCols(part.size);
        HalfSolve(m, m.step_model().parts[p], Y);
      }
      for (std::size_t g = 0; g < part.groups.size(); ++g) {
        const Eigen::Index column = 6 * static_cast<Eigen::Index>(g);
        rows_.velocities.segment<6>(part.offset + column) =
            GroupTwist(m, part.groups[g], part.J_T.middleCols(column, 6));
      }
      for (std::size_t k = 0; k < part.limits.size(); ++k)
        rows_.velocities(part.offset + part.LimitRow(k)) =
            LengthRate(m, m.length_limits()[static_cast<std::size_t>(part.limits[k] / 2)].length);
      for (std::size_t k = 0; k < part.frictions.size(); ++k)
        rows_.velocities(part.offset + part.FrictionRow(k)) =
            LengthRate(m, m.mechanism().frictions()[static_cast<std::size_t>(part.frictions[k])].length);
      for (std::size_t k = 0; k < part.bounded_forces.size(); ++k)
        rows_.velocities(part.offset + part.BoundedForceRow(k)) =
            LengthRate(m, LengthOfBoundedForce(m, static_cast<std::size_t>(part.bounded_forces[k])));
    }
  });
  rows_.blocks.clear();
  for (MechanismRows& block : rows_.mechanisms)
    for (PartRows& part : block.parts)
      if (const int freedoms = static_cast<int>(part.Y.rows()); part.size > 0)
        rows_.blocks.push_back({part.offset, part.size, part.Y.data(), freedoms, freedoms});
  for (std::size_t c = 0; c < detection_.contactors.size(); ++c)
    if (detection_.contactors[c].kind == Contactor::Kind::kFreeBody && rows_.port_offset[c] >= 0) {
      const auto b = static_cast<std::size_t>(detection_.contactors[c].index);
      rows_.velocities.segment<6>(rows_.port_offset[c]) = bodies_.free_bodies[b].PortTwist();
      rows_.free_Y[b] = bodies_.free_bodies[b].InverseInertiaRoot();
      rows_.blocks.push_back({rows_.port_offset[c], 6, rows_.free_Y[b].data(), 6, 6});
    }
}

}  // namespace fork1s
