#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>

#include "world_detail.hpp"

namespace fork1s {

void World::Detail::FindContacts(const StepOptions& options, StepReport& report) {
  const PartClock clock(times_, &StepPartTimes::finding);
  // What can close within a step: twice the last step's motion, what gravity adds, and a millimetre.
  contactor_motion_.assign(contactors_.size(), 0.0);
  constexpr int kWorthAThread = 100;  // some 30 us
  ForAll(contactors_.size(), kWorthAThread, [&](std::size_t i) {
    const Contactor& c = contactors_[i];
    if (c.kind == Contactor::Kind::kWorld) return;
    const RigidTransform X = c.kind == Contactor::Kind::kGroup
                                 ? mechanisms_[static_cast<std::size_t>(c.index)].GroupPose(c.group)
                                 : free_bodies_[static_cast<std::size_t>(c.index)].pose();
    collision_->SetPose(static_cast<int>(i), X);
    if (!has_previous_pose_) {
      const Vector6 V = c.kind == Contactor::Kind::kGroup
                            ? mechanisms_[static_cast<std::size_t>(c.index)].GroupVelocity(c.group)
                            : free_bodies_[static_cast<std::size_t>(c.index)].OriginVelocity();
      contactor_motion_[i] = options.h * (V.tail<3>().norm() + V.head<3>().norm() * contactor_radius_[i]);
      contactor_pose_[i] = X;
      return;
    }
    const RigidTransform& before = contactor_pose_[i];
    // |R - R₀| (Frobenius) is √2 times the angle for small turns.
    const double turn = (X.rotation() - before.rotation()).norm();
    contactor_motion_[i] = (X.translation() - before.translation()).norm() + turn * contactor_radius_[i];
    contactor_pose_[i] = X;
  });
  double motion = 0;
  for (const double own : contactor_motion_) motion = std::max(motion, own);
  if (by_theta_) motion = MotionWithin(middle_ ? 0.5 * options.h : options.h);
  const double needed = 0.001 + 2 * motion + options.gravity.norm() * options.h * options.h;
  collision_->SetMargin(std::min(margin_max_, needed));
  has_previous_pose_ = true;
  report.contacts_dropped = !collision_->Detect(points_);
}

// Room for every part of a mechanism; parts change only when its reference moves.
void World::Detail::SizeBlocks(std::size_t mechanism) {
  const MechanismDynamics& m = mechanisms_[mechanism];
  MechanismBlock& block = mechanism_blocks_[mechanism];
  const std::size_t count = m.parts().size() + 1;
  bool fits = block.parts.size() == count && block.impulse.size() == m.num_velocities();
  for (std::size_t p = 0; fits && p + 1 < count; ++p) fits = block.parts[p].J_T.rows() == m.parts()[p].size;
  if (fits) return;
  block.impulse.resize(m.num_velocities());
  block.parts.assign(count, PartBlock());
  std::vector<int> groups(count, 0), limits(count, 0), frictions(count, 0);
  for (std::size_t g = 0; g < m.groups().size(); ++g) {
    const int part = m.PartOfGroup(static_cast<int>(g));
    ++groups[part < 0 ? count - 1 : static_cast<std::size_t>(part)];
  }
  for (std::size_t k = 0; k < m.length_limits().size(); ++k)
    limits[static_cast<std::size_t>(m.PartOfLimited(k))] += 2;
  for (std::size_t k = 0; k < m.mechanism().frictions().size(); ++k)
    ++frictions[static_cast<std::size_t>(m.PartOfFriction(k))];
  for (std::size_t p = 0; p < count; ++p) {
    PartBlock& part = block.parts[p];
    const int room = 6 * groups[p] + limits[p] + frictions[p], size = p + 1 < count ? m.parts()[p].size : 0;
    part.groups.reserve(static_cast<std::size_t>(groups[p]));
    part.limits.reserve(static_cast<std::size_t>(limits[p]));
    part.frictions.reserve(static_cast<std::size_t>(frictions[p]));
    part.J.resize(6, size);
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
  }
  // Loops may hold a mechanism on a fixed base altogether: then it has no part that stops or friction could
  // act in.
  const bool moves = !m.parts().empty();
  for (std::size_t k = 0; moves && k < m.mechanism().frictions().size(); ++k)
    block.parts[static_cast<std::size_t>(m.PartOfFriction(k))].frictions.push_back(static_cast<int>(k));
  for (std::size_t k = 0; k < m.length_limits().size(); ++k) {
    const Mechanism::LengthLimit& limit = m.length_limits()[k];
    const double length = m.Length(limit.length);
    // Near enough to be reached within the step, with room for what contacts may add.
    const double reach = 0.02 + 2 * options.h * std::abs(m.LengthRate(limit.length));
    const double gap[2] = {length - limit.lower, limit.upper - length};
    for (int side = 0; side < 2; ++side) {
      const int at = static_cast<int>(2 * k) + side;
      if (moves && gap[side] < reach)
        block.parts[static_cast<std::size_t>(m.PartOfLimited(k))].limits.push_back(at);
      else
        block.limit_impulses[static_cast<std::size_t>(at)] = 0;
    }
  }
}

// Jᵀ of every part of a mechanism, and the twists of its groups at the start of the step.
void World::Detail::FillRows(std::size_t i) {
  const MechanismDynamics& m = mechanisms_[i];
  for (std::size_t p = 0; p < mechanism_blocks_[i].parts.size(); ++p) {
    PartBlock& part = mechanism_blocks_[i].parts[p];
    for (std::size_t g = 0; g < part.groups.size(); ++g) {
      const Eigen::Index column = 6 * static_cast<Eigen::Index>(g);
      m.GroupJacobian(part.groups[g], part.J);
      part.J_T.middleCols(column, 6) = part.J.transpose();
      velocities_.segment<6>(part.offset + column) =
          m.GroupTwist(part.groups[g], part.J_T.middleCols(column, 6));
    }
    for (std::size_t k = 0; k < part.limits.size(); ++k) {
      const Eigen::Index column =
          6 * static_cast<Eigen::Index>(part.groups.size()) + static_cast<Eigen::Index>(k);
      m.LengthRow(m.length_limits()[static_cast<std::size_t>(part.limits[k] / 2)].length, m.parts()[p],
                  part.J_T.col(column));
    }
    for (std::size_t k = 0; k < part.frictions.size(); ++k)
      m.LengthRow(m.mechanism().frictions()[static_cast<std::size_t>(part.frictions[k])].length, m.parts()[p],
                  part.J_T.col(part.FrictionRow(k)));
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
    const int part = mechanisms_[i].PartOfGroup(contactors_[c].group);
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
      offset += part.rows;
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
      offset += 6;
    }
  }
}

// A contact is the one of the last step that lies at the same place of either body: a corner of one keeps its
// place there however far it slides on the other, and where neither keeps its place it is the nearest one. Of
// all such pairs the nearest first, whatever order the detector found them in.
void World::Detail::MatchPrevious() {
  match_.assign(points_.size(), -1);
  const auto who = [](const ContactPoint& p) {
    return std::tuple(p.body_a, p.body_b, p.geometry_a, p.geometry_b);
  };
  const auto of = [&](int k) -> const ContactPoint& { return previous_[static_cast<std::size_t>(k)].point; };
  const auto before = [&](int k, int l) { return std::pair(who(of(k)), k) < std::pair(who(of(l)), l); };
  previous_order_.resize(previous_.size());
  std::iota(previous_order_.begin(), previous_order_.end(), 0);
  if (!std::is_sorted(previous_order_.begin(), previous_order_.end(), before))
    std::sort(previous_order_.begin(), previous_order_.end(), before);
  previous_used_.assign(previous_.size(), 0);
  // Points between the same two shapes follow each other.
  for (std::size_t begin = 0, end = 0; begin < points_.size(); begin = end) {
    const auto shapes = who(points_[begin]);
    while (end < points_.size() && who(points_[end]) == shapes) ++end;
    const auto first = std::lower_bound(previous_order_.begin(), previous_order_.end(), shapes,
                                        [&](int k, const auto& wanted) { return who(of(k)) < wanted; });
    auto last = first;
    while (last != previous_order_.end() && who(of(*last)) == shapes) ++last;
    const int* order = previous_order_.data();
    AddCandidates(begin, end, order + (first - previous_order_.begin()),
                  order + (last - previous_order_.begin()));
    std::sort(candidates_.begin(), candidates_.end());
    for (const auto& [moved, i, k] : candidates_) {
      if (match_[static_cast<std::size_t>(i)] >= 0 || previous_used_[static_cast<std::size_t>(k)]) continue;
      match_[static_cast<std::size_t>(i)] = k;
      previous_used_[static_cast<std::size_t>(k)] = 1;
    }
  }
}

void World::Detail::AddCandidates(std::size_t begin, std::size_t end, const int* first, const int* last) {
  constexpr double kFarthest = 0.02 * 0.02;  // m²: what moved farther over both bodies is another contact
  constexpr double kStays = 1e-4 * 1e-4;     // m²: points nearer than that carry what one of them carries
  candidates_.clear();
  const auto add = [&](const auto& distance) {
    double farthest = 0;  // of the points that are nearest to each
    for (std::size_t i = begin; i < end; ++i) {
      double nearest = kFarthest;
      for (const int* k = first; k != last; ++k) {
        const ContactPoint& o = previous_[static_cast<std::size_t>(*k)].point;
        if (o.frame.row(0).dot(points_[i].frame.row(0)) <= 0.8) continue;
        const double moved = distance(i, k, o);
        nearest = std::min(nearest, moved);
        if (moved < kFarthest) candidates_.push_back({moved, static_cast<int>(i), *k});
      }
      farthest = std::max(farthest, nearest);
    }
    return farthest;
  };
  const double farthest = add([&](std::size_t i, const int*, const ContactPoint& o) {
    return (o.point - points_[i].point).squaredNorm();
  });
  const bool one_each = end == begin + 1 && last == first + 1;
  if (first == last || farthest < (one_each ? kFarthest : kStays)) return;

  places_.clear();
  const auto keep = [&](const ContactPoint& p, const std::vector<RigidTransform>& poses) {
    const auto on = [&](int contactor) -> Vector3 {
      const RigidTransform& X = poses[static_cast<std::size_t>(contactor)];
      return X.rotation().transpose() * (p.point - X.translation());
    };
    const auto beside = [&](int contactor) -> Vector3 {
      return p.point - poses[static_cast<std::size_t>(contactor)].translation();
    };
    places_.push_back({on(p.body_a), on(p.body_b), beside(p.body_a), beside(p.body_b)});
  };
  for (const int* k = first; k != last; ++k)
    keep(previous_[static_cast<std::size_t>(*k)].point, previous_pose_);
  for (std::size_t i = begin; i < end; ++i) keep(points_[i], contactor_pose_);
  candidates_.clear();
  add([&](std::size_t i, const int* k, const ContactPoint& o) {
    const auto &then = places_[static_cast<std::size_t>(k - first)],
               &now = places_[static_cast<std::size_t>(last - first) + i - begin];
    double nearest = (o.point - points_[i].point).squaredNorm();
    for (std::size_t w = 0; w < now.size(); ++w)
      nearest = std::min(nearest, (now[w] - then[w]).squaredNorm());
    return nearest;
  });
}

// After Predict: Y of every block, the free velocities, and the rows of contacts and limits.
void World::Detail::AssembleOperators() {
  ForMechanisms([&](std::size_t i) {
    const MechanismDynamics& m = mechanisms_[i];
    for (std::size_t p = 0; p < mechanism_blocks_[i].parts.size(); ++p) {
      PartBlock& part = mechanism_blocks_[i].parts[p];
      if (part.rows == 0) continue;
      if (p < m.parts().size()) {
        auto Y = part.Y.leftCols(part.rows);
        Y = part.J_T.leftCols(part.rows);
        m.HalfSolve(m.parts()[p], Y);
      }
      for (std::size_t g = 0; g < part.groups.size(); ++g) {
        const Eigen::Index column = 6 * static_cast<Eigen::Index>(g);
        velocities_.segment<6>(part.offset + column) =
            m.GroupTwist(part.groups[g], part.J_T.middleCols(column, 6));
      }
      for (std::size_t k = 0; k < part.limits.size(); ++k)
        velocities_(part.offset + 6 * static_cast<Eigen::Index>(part.groups.size()) +
                    static_cast<Eigen::Index>(k)) =
            m.LengthRate(m.length_limits()[static_cast<std::size_t>(part.limits[k] / 2)].length);
      for (std::size_t k = 0; k < part.frictions.size(); ++k)
        velocities_(part.offset + part.FrictionRow(k)) =
            m.LengthRate(m.mechanism().frictions()[static_cast<std::size_t>(part.frictions[k])].length);
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

void World::Detail::ApplyImpulses() {
  for (MechanismBlock& block : mechanism_blocks_)
    for (PartBlock& part : block.parts) part.port_impulse.head(part.rows).setZero();
  for (MechanismBlock& block : mechanism_blocks_) block.pushed_from_outside = false;
  auto add = [&](int port, int contactor, const Vector6& F) {
    const Contactor& c = contactors_[static_cast<std::size_t>(contactor)];
    if (c.kind == Contactor::Kind::kFreeBody)
      free_bodies_[static_cast<std::size_t>(c.index)].SetPortTwist(velocities_.segment<6>(port));
    if (c.kind != Contactor::Kind::kGroup) return;
    PartBlock& part = mechanism_blocks_[static_cast<std::size_t>(c.index)]
                          .parts[static_cast<std::size_t>(port_part_[static_cast<std::size_t>(contactor)])];
    part.port_impulse.segment<6>(port - part.offset) += F;
  };
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const ContactConstraint& c = constraints_[i];
    if (c.impulse.isZero(0)) continue;
    const Contactor& a = contactors_[static_cast<std::size_t>(points_[i].body_a)];
    const Contactor& b = contactors_[static_cast<std::size_t>(points_[i].body_b)];
    const bool own = a.kind == b.kind && a.index == b.index;
    for (const Contactor* side : {&a, &b})
      if (side->kind == Contactor::Kind::kGroup && !own)
        mechanism_blocks_[static_cast<std::size_t>(side->index)].pushed_from_outside = true;
    if (c.port_a >= 0) add(c.port_a, points_[i].body_a, c.ImpulseOn(c.J_a));
    if (c.port_b >= 0) add(c.port_b, points_[i].body_b, c.ImpulseOn(c.J_b));
  }
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
      const MechanismDynamics::Part& run = mechanisms_[i].parts()[p];
      block.impulse.segment(run.begin, run.size).noalias() =
          part.J_T.leftCols(part.rows) * part.port_impulse.head(part.rows);
      pushed = true;
    }
    if (pushed) mechanisms_[i].ApplyImpulse(block.impulse, block.pushed_from_outside);
  });
}

void World::Detail::KeepForNextStep(double h, StepReport& report) {
  contacts_.resize(points_.size());
  speed_W_.resize(points_.size());
  missed_W_.resize(points_.size());
  change_ = velocities_ - change_;
  ForContacts([&](std::size_t i) {
    const ContactConstraint& c = constraints_[i];
    contacts_[i].point = points_[i];
    contacts_[i].impulse = c.impulse;
    contacts_[i].friction = c.friction;
    contacts_[i].moment = c.moment;
    contacts_[i].use = c.use;
    speed_W_[i] = points_[i].frame.transpose() * RelativeSpeed(c);
    missed_W_[i] = by_theta_ ? Vector3(Vector3::Zero()) : MissedWay(h, i);
  });
  for (const ContactRecord& c : contacts_)
    if (c.impulse(0) > 0) {
      ++report.contacts;
      report.max_penetration = std::max(report.max_penetration, -c.point.gap);
    }
  for (std::size_t c = 0; c < contactors_.size(); ++c)
    if (port_offset_[c] >= 0) last_twist_[c] = velocities_.segment<6>(port_offset_[c]);
  for (const LimitConstraint& row : limits_) {
    const bool is_friction = row.lower < 0;
    report.limits += !is_friction && row.impulse > 0 ? 1 : 0;
  }
  for (const MechanismDynamics& m : mechanisms_) report.forces_at_bound += m.NumForcesAtBound();
}

}  // namespace fork1s
