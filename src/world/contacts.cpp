#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>

#include "detail.hpp"

namespace fork1s {

bool World::Detail::FindContacts(const StepOptions& options, StepReport& report) {
  const PartClock clock(times_, &StepPartTimes::finding);
  // What can close within a step: twice the last step's motion, what gravity adds, and what was not
  // foreseen.
  contactor_motion_.assign(contactors_.size(), 0.0);
  constexpr int kWorthAThread = 100;  // some 30 us
  ForAll(contactors_.size(), kWorthAThread, [&](std::size_t i) {
    const Contactor& c = contactors_[i];
    if (c.kind == Contactor::Kind::kWorld) return;
    const RigidTransform X = PoseOf(c);
    collision_->SetPose(static_cast<int>(i), X);
    if (in_stage_) contactor_motion_[i] = MotionBetween(stage_start_pose_[i], X, contactor_radius_[i]);
    contactor_pose_[i] = X;
  });
  const double motion = MotionWithin(options.h);
  const double needed =
      kClearShare * least_size_ + 2 * motion + options.gravity.norm() * options.h * options.h;
  search_margin_ = std::max(least_margin_, std::min(margin_max_, needed));
  if (in_stage_) search_margin_ = std::max(search_margin_, LargestPairMotion());
  if (!std::isfinite(search_margin_)) return false;
  collision_->SetMargin(search_margin_);
  report.contacts_dropped = !collision_->Detect(points_);
  return true;
}

// Room for every part of a mechanism; parts change only when its reference moves.
void World::Detail::SizeBlocks(std::size_t mechanism) {
  const MechanismDynamics& m = mechanisms_[mechanism];
  MechanismBlock& block = mechanism_blocks_[mechanism];
  const std::size_t count = m.step_model().parts.size() + 1;
  bool fits = block.parts.size() == count && block.impulse.size() == m.num_velocities();
  for (std::size_t p = 0; fits && p + 1 < count; ++p)
    fits = block.parts[p].J_T.rows() == m.step_model().parts[p].size;
  if (fits) return;
  block.impulse.resize(m.num_velocities());
  block.parts.assign(count, PartBlock());
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
    PartBlock& part = block.parts[p];
    const int room = 6 * groups[p] + limits[p] + frictions[p] + bounded_forces[p],
              size = p + 1 < count ? m.step_model().parts[p].size : 0;
    part.groups.reserve(static_cast<std::size_t>(groups[p]));
    part.limits.reserve(static_cast<std::size_t>(limits[p]));
    part.frictions.reserve(static_cast<std::size_t>(frictions[p]));
    part.bounded_forces.reserve(static_cast<std::size_t>(bounded_forces[p]));
    part.room = bounded_forces[p];
    part.J_T.resize(size, room);
    part.Y.resize(size, room);
    part.port_impulse.resize(room);
  }
}

// Which stops and dry friction of a mechanism take part.
void World::Detail::LayOutLimits(std::size_t i, const StepOptions& options) {
  const MechanismDynamics& m = mechanisms_[i];
  MechanismBlock& block = mechanism_blocks_[i];
  SizeBlocks(i);
  for (PartBlock& part : block.parts) {
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
      block.stop_is_row[static_cast<std::size_t>(at)] = moves && (all_stops_ || gap[side] < reach);
      if (block.stop_is_row[static_cast<std::size_t>(at)])
        block.parts[static_cast<std::size_t>(m.step_model().part_of_limited[k])].limits.push_back(at);
      else
        block.limit_impulses[static_cast<std::size_t>(at)] = 0;
    }
  }
}

// Jᵀ of every part of a mechanism, and the twists of its groups at the start of the step.
void World::Detail::FillRows(std::size_t i) {
  const MechanismDynamics& m = mechanisms_[i];
  const bool at_start = in_stage_ && (is_backward_euler_ || from_stage_start_);
  for (std::size_t p = 0; p < mechanism_blocks_[i].parts.size(); ++p) {
    PartBlock& part = mechanism_blocks_[i].parts[p];
    for (std::size_t g = 0; g < part.groups.size(); ++g) {
      const Eigen::Index column = 6 * static_cast<Eigen::Index>(g);
      GroupJacobian(m, part.groups[g], part.J_T.middleCols(column, 6));
      const auto J_T = part.J_T.middleCols(column, 6);
      velocities_.segment<6>(part.offset + column) = GroupTwist(m, part.groups[g], J_T);
      if (at_start) start_velocities_.segment<6>(part.offset + column) = GroupTwistAtStart(m, part.groups[g], J_T);
    }
    for (std::size_t k = 0; k < part.limits.size(); ++k) {
      const Eigen::Index column =
          6 * static_cast<Eigen::Index>(part.groups.size()) + static_cast<Eigen::Index>(k);
      LengthRow(m, m.length_limits()[static_cast<std::size_t>(part.limits[k] / 2)].length,
                m.step_model().parts[p], part.J_T.col(column));
    }
    for (std::size_t k = 0; k < part.frictions.size(); ++k)
      LengthRow(m, m.mechanism().frictions()[static_cast<std::size_t>(part.frictions[k])].length,
                m.step_model().parts[p], part.J_T.col(part.FrictionRow(k)));
  }
}

// Which ports and limits take part, and where they stand in the stacked velocities. Fills Jᵀ of every part
// and, in velocities_, the twists at the start of the step.
void World::Detail::LayOutPorts(const StepOptions& options) {
  std::fill(port_offset_.begin(), port_offset_.end(), -1);
  for (const ContactPoint& p : points_)
    for (int side : {p.body_a, p.body_b})
      if (contactors_[static_cast<std::size_t>(side)].kind != Contactor::Kind::kWorld)
        port_offset_[static_cast<std::size_t>(side)] = 0;

  ForMechanisms([&](std::size_t i) { LayOutLimits(i, options); });
  // Ports first get their place within their part, then the parts theirs.
  for (std::size_t c = 0; c < contactors_.size(); ++c) {
    if (contactors_[c].kind != Contactor::Kind::kGroup || port_offset_[c] < 0) continue;
    const auto i = static_cast<std::size_t>(contactors_[c].index);
    auto& parts = mechanism_blocks_[i].parts;
    const int part = mechanisms_[i].step_model().PartOfGroup(contactors_[c].group);
    port_part_[c] = part < 0 ? static_cast<int>(parts.size()) - 1 : part;
    auto& groups = parts[static_cast<std::size_t>(port_part_[c])].groups;
    port_offset_[c] = 6 * static_cast<int>(groups.size());
    groups.push_back(contactors_[c].group);
  }
  int offset = 0;
  for (MechanismBlock& block : mechanism_blocks_)
    for (PartBlock& part : block.parts) {
      part.offset = offset;
      part.rows = static_cast<int>(6 * part.groups.size() + part.limits.size() + part.frictions.size());
      offset += part.rows + part.room;
    }
  ForMechanisms([&](std::size_t i) { FillRows(i); });
  for (std::size_t c = 0; c < contactors_.size(); ++c) {
    if (port_offset_[c] < 0) continue;
    const auto i = static_cast<std::size_t>(contactors_[c].index);
    if (contactors_[c].kind == Contactor::Kind::kGroup) {
      port_offset_[c] += mechanism_blocks_[i].parts[static_cast<std::size_t>(port_part_[c])].offset;
    } else {
      port_offset_[c] = offset;
      velocities_.segment<6>(offset) = free_bodies_[i].PortTwist();
      start_velocities_.segment<6>(offset) = free_bodies_[i].StartPortTwist();
      offset += 6;
    }
  }
}

// After Predict: Y of every block, the free velocities, and the rows of contacts and limits.
void World::Detail::AssembleOperators() {
  ForMechanisms([&](std::size_t i) {
    const MechanismDynamics& m = mechanisms_[i];
    for (std::size_t p = 0; p < mechanism_blocks_[i].parts.size(); ++p) {
      PartBlock& part = mechanism_blocks_[i].parts[p];
      if (part.rows == 0) continue;
      if (p < m.step_model().parts.size()) {
        auto Y = part.Y.leftCols(part.rows);
        Y = part.J_T.leftCols(part.rows);
        HalfSolve(m, m.step_model().parts[p], Y);
      }
      for (std::size_t g = 0; g < part.groups.size(); ++g) {
        const Eigen::Index column = 6 * static_cast<Eigen::Index>(g);
        velocities_.segment<6>(part.offset + column) =
            GroupTwist(m, part.groups[g], part.J_T.middleCols(column, 6));
      }
      for (std::size_t k = 0; k < part.limits.size(); ++k)
        velocities_(part.offset + 6 * static_cast<Eigen::Index>(part.groups.size()) +
                    static_cast<Eigen::Index>(k)) =
            LengthRate(m, m.length_limits()[static_cast<std::size_t>(part.limits[k] / 2)].length);
      for (std::size_t k = 0; k < part.frictions.size(); ++k)
        velocities_(part.offset + part.FrictionRow(k)) =
            LengthRate(m, m.mechanism().frictions()[static_cast<std::size_t>(part.frictions[k])].length);
      for (std::size_t k = 0; k < part.bounded_forces.size(); ++k)
        velocities_(part.offset + part.BoundedForceRow(k)) =
            LengthRate(m, LengthOfBoundedForce(m, static_cast<std::size_t>(part.bounded_forces[k])));
    }
  });
  blocks_.clear();
  for (MechanismBlock& block : mechanism_blocks_)
    for (PartBlock& part : block.parts)
      if (const int freedoms = static_cast<int>(part.Y.rows()); part.rows > 0)
        blocks_.push_back({part.offset, part.rows, part.Y.data(), freedoms, freedoms});
  for (std::size_t c = 0; c < contactors_.size(); ++c)
    if (contactors_[c].kind == Contactor::Kind::kFreeBody && port_offset_[c] >= 0) {
      const auto b = static_cast<std::size_t>(contactors_[c].index);
      velocities_.segment<6>(port_offset_[c]) = free_bodies_[b].PortTwist();
      free_Y_[b] = free_bodies_[b].InverseInertiaRoot();
      blocks_.push_back({port_offset_[c], 6, free_Y_[b].data(), 6, 6});
    }
}

}  // namespace fork1s
