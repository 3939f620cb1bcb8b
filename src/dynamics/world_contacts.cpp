#include <algorithm>
#include <cmath>
#include <fork1s/dynamics/world.hpp>

namespace fork1s {

// Rows of the contact frame on the twist of a port: mechanisms in their root frame about its origin, free
// bodies in world axes about their centre of mass.
Matrix36 World::PortRows(const Contactor& contactor, const ContactPoint& point) const {
  Matrix36 J;
  if (contactor.kind == Contactor::Kind::kGroup) {
    const RigidTransform& X_WR = mechanisms_[static_cast<std::size_t>(contactor.index)].state().X_WR;
    const Vector3 p = X_WR.rotation().transpose() * (point.point - X_WR.translation());
    J.rightCols<3>().noalias() = point.frame * X_WR.rotation();
    J.leftCols<3>().noalias() = -J.rightCols<3>() * Skew(p);
  } else {
    const Vector3 arm = point.point - free_bodies_[static_cast<std::size_t>(contactor.index)].center_W();
    J.rightCols<3>() = point.frame;
    J.leftCols<3>().noalias() = -point.frame * Skew(arm);
  }
  return J;
}

void World::FindContacts(const StepOptions& options, StepReport& report) {
  // What can close within a step: twice the last step's motion, what gravity adds, and a millimetre.
  double motion = 0;
  for (std::size_t i = 0; i < contactors_.size(); ++i) {
    const Contactor& c = contactors_[i];
    if (c.kind == Contactor::Kind::kWorld) continue;
    const RigidTransform X = c.kind == Contactor::Kind::kGroup
                                 ? mechanisms_[static_cast<std::size_t>(c.index)].GroupPose(c.group)
                                 : free_bodies_[static_cast<std::size_t>(c.index)].pose();
    collision_->SetPose(static_cast<int>(i), X);
    const RigidTransform& before = contactor_pose_[i];
    // |R - R₀| (Frobenius) is √2 times the angle for small turns.
    const double turn = (X.rotation() - before.rotation()).norm();
    motion = std::max(motion, (X.translation() - before.translation()).norm() + turn * contactor_radius_[i]);
    contactor_pose_[i] = X;
  }
  const double needed = 0.001 + 2 * motion + options.gravity.norm() * options.h * options.h;
  collision_->SetMargin(has_previous_pose_ ? std::min(margin_max_, needed) : margin_max_);
  has_previous_pose_ = true;
  report.contacts_dropped = !collision_->Detect(points_);
}

// Which ports and limits take part, and where they stand in the stacked velocities. Fills Jᵀ of every
// mechanism and, in velocities_, the twists at the start of the step.
void World::LayOutPorts(const StepOptions& options) {
  std::fill(port_offset_.begin(), port_offset_.end(), -1);
  for (const ContactPoint& p : points_)
    for (int side : {p.body_a, p.body_b})
      if (contactors_[static_cast<std::size_t>(side)].kind != Contactor::Kind::kWorld)
        port_offset_[static_cast<std::size_t>(side)] = 0;

  int offset = 0;
  for (std::size_t i = 0; i < mechanisms_.size(); ++i) {
    const MechanismDynamics& m = mechanisms_[i];
    MechanismBlock& block = mechanism_blocks_[i];
    block.offset = offset;
    block.groups.clear();
    block.limits.clear();
    for (std::size_t c = 0; c < contactors_.size(); ++c)
      if (contactors_[c].kind == Contactor::Kind::kGroup && contactors_[c].index == static_cast<int>(i) &&
          port_offset_[c] == 0) {
        port_offset_[c] = offset + 6 * static_cast<int>(block.groups.size());
        block.groups.push_back(contactors_[c].group);
      }
    const auto& limited = m.limited_coordinates();
    for (std::size_t k = 0; k < limited.size(); ++k) {
      const int coordinate = limited[k];
      const double q = m.configuration().q(coordinate), rate = m.CoordinateRate(coordinate);
      // Near enough to be reached within the step, with room for what contacts may add.
      const double reach = 0.02 + 2 * options.h * std::abs(rate);
      const double gap[2] = {q - m.lower()(coordinate), m.upper()(coordinate) - q};
      for (int side = 0; side < 2; ++side)
        if (gap[side] < reach)
          block.limits.push_back(static_cast<int>(2 * k) + side);
        else
          block.limit_impulses[2 * k + static_cast<std::size_t>(side)] = 0;
    }
    block.rows = static_cast<int>(6 * block.groups.size() + block.limits.size());
    offset += block.rows;
    const int nx = m.num_velocities();
    if (block.J_T.rows() != nx || block.J_T.cols() < block.rows) {
      const int room = std::max(block.rows, static_cast<int>(6 * m.groups().size() + 2 * limited.size()));
      block.J_T.resize(nx, room);
      block.Y.resize(nx, room);
      block.W.resize(room, room);
      block.impulse.resize(nx);
      block.port_impulse.resize(room);
      if (J_scratch_.cols() < nx) J_scratch_.resize(6, nx);
    }
    for (std::size_t g = 0; g < block.groups.size(); ++g) {
      auto J = J_scratch_.leftCols(nx);
      m.GroupJacobian(block.groups[g], J);
      block.J_T.middleCols(6 * static_cast<Eigen::Index>(g), 6) = J.transpose();
      velocities_.segment<6>(block.offset + 6 * static_cast<Eigen::Index>(g)) = m.GroupTwist(J);
    }
    for (std::size_t k = 0; k < block.limits.size(); ++k) {
      const Eigen::Index column =
          6 * static_cast<Eigen::Index>(block.groups.size()) + static_cast<Eigen::Index>(k);
      m.CoordinateRow(limited[static_cast<std::size_t>(block.limits[k] / 2)], block.J_T.col(column));
    }
  }
  for (std::size_t c = 0; c < contactors_.size(); ++c)
    if (contactors_[c].kind == Contactor::Kind::kFreeBody && port_offset_[c] == 0) {
      port_offset_[c] = offset;
      velocities_.segment<6>(offset) =
          free_bodies_[static_cast<std::size_t>(contactors_[c].index)].PortTwist();
      offset += 6;
    }
}

void World::MatchPrevious() {
  match_.assign(points_.size(), -1);
  previous_used_.assign(previous_.size(), 0);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const ContactPoint& p = points_[i];
    double best = 0.02;  // m; a contact point that moved farther than this in a step is another one
    for (std::size_t k = 0; k < previous_.size(); ++k) {
      const ContactPoint& o = previous_[k].point;
      if (previous_used_[k] || o.body_a != p.body_a || o.body_b != p.body_b || o.geometry_a != p.geometry_a ||
          o.geometry_b != p.geometry_b)
        continue;
      const double distance = (o.point - p.point).norm();
      if (distance < best && o.frame.row(0).dot(p.frame.row(0)) > 0.8) {
        best = distance;
        match_[i] = static_cast<int>(k);
      }
    }
    if (match_[i] >= 0) previous_used_[static_cast<std::size_t>(match_[i])] = 1;
  }
}

// After Predict: W of every block, the free velocities, and the rows of contacts and limits.
void World::AssembleOperators() {
  blocks_.clear();
  for (std::size_t i = 0; i < mechanisms_.size(); ++i) {
    MechanismBlock& block = mechanism_blocks_[i];
    if (block.rows == 0) continue;
    const MechanismDynamics& m = mechanisms_[i];
    auto J_T = block.J_T.leftCols(block.rows);
    auto Y = block.Y.leftCols(block.rows);
    Y = J_T;
    m.HalfSolve(Y);
    block.W.topLeftCorner(block.rows, block.rows).noalias() = Y.transpose() * Y;
    for (std::size_t g = 0; g < block.groups.size(); ++g) {
      auto J = J_scratch_.leftCols(m.num_velocities());
      J = J_T.middleCols(6 * static_cast<Eigen::Index>(g), 6).transpose();
      velocities_.segment<6>(block.offset + 6 * static_cast<Eigen::Index>(g)) = m.GroupTwist(J);
    }
    for (std::size_t k = 0; k < block.limits.size(); ++k)
      velocities_(block.offset + 6 * static_cast<Eigen::Index>(block.groups.size()) +
                  static_cast<Eigen::Index>(k)) =
          m.CoordinateRate(m.limited_coordinates()[static_cast<std::size_t>(block.limits[k] / 2)]);
    blocks_.push_back({block.offset, block.rows, block.W.data(), static_cast<int>(block.W.rows())});
  }
  for (std::size_t c = 0; c < contactors_.size(); ++c)
    if (contactors_[c].kind == Contactor::Kind::kFreeBody && port_offset_[c] >= 0) {
      const auto b = static_cast<std::size_t>(contactors_[c].index);
      velocities_.segment<6>(port_offset_[c]) = free_bodies_[b].PortTwist();
      free_W_[b] = free_bodies_[b].InverseInertia();
      blocks_.push_back({port_offset_[c], 6, free_W_[b].data(), 6});
    }
}

void World::AssembleConstraints(const StepOptions& options) {
  const double h = options.h;
  // Positive gaps may close within the step; penetration beyond the slop is undone in shares of β.
  auto bias = [&](double gap) {
    if (gap > 0) return gap / h;
    return std::max(options.penetration_correction * std::min(0.0, gap + options.slop) / h,
                    -options.max_correction_speed);
  };
  constraints_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const ContactPoint& p = points_[i];
    ContactConstraint& c = constraints_[i];
    c = ContactConstraint{};
    c.friction = p.friction;
    c.bias(0) = bias(p.gap);
    const Contactor& a = contactors_[static_cast<std::size_t>(p.body_a)];
    const Contactor& b = contactors_[static_cast<std::size_t>(p.body_b)];
    double normal_speed = 0;
    if (a.kind != Contactor::Kind::kWorld) {
      c.port_a = port_offset_[static_cast<std::size_t>(p.body_a)];
      c.J_a = -PortRows(a, p);
      normal_speed += c.J_a.row(0).dot(velocities_.segment<6>(c.port_a));
    }
    if (b.kind != Contactor::Kind::kWorld) {
      c.port_b = port_offset_[static_cast<std::size_t>(p.body_b)];
      c.J_b = PortRows(b, p);
      normal_speed += c.J_b.row(0).dot(velocities_.segment<6>(c.port_b));
    }
    if (match_[i] < 0) continue;
    const auto k = static_cast<std::size_t>(match_[i]);
    const ContactRecord& before = previous_[k];
    c.impulse = p.frame * (before.point.frame.transpose() * before.impulse);
    // (h/2) J̇_n V by difference: the same velocity seen by this step's row and by the last one's.
    if (options.contact_curvature && curvature_valid_ && before.impulse(0) > 0)
      c.bias(0) += 0.5 * (normal_speed - previous_normal_speed_[k]);
  }

  limits_.clear();
  for (std::size_t i = 0; i < mechanisms_.size(); ++i) {
    const MechanismDynamics& m = mechanisms_[i];
    const MechanismBlock& block = mechanism_blocks_[i];
    for (std::size_t k = 0; k < block.limits.size(); ++k) {
      const auto at = static_cast<std::size_t>(block.limits[k]);
      const int coordinate = m.limited_coordinates()[at / 2];
      const bool upper = at % 2 == 1;
      const double q = m.configuration().q(coordinate);
      LimitConstraint limit;
      limit.row = block.offset + static_cast<int>(6 * block.groups.size() + k);
      limit.sign = upper ? -1 : 1;
      limit.bias = bias(upper ? m.upper()(coordinate) - q : q - m.lower()(coordinate));
      limit.impulse = block.limit_impulses[at];
      limits_.push_back(limit);
    }
  }
}

void World::ApplyImpulses() {
  for (MechanismBlock& block : mechanism_blocks_) block.port_impulse.setZero();
  auto add = [&](int port, const Contactor& contactor, const Vector6& F) {
    if (contactor.kind != Contactor::Kind::kGroup) return;
    MechanismBlock& block = mechanism_blocks_[static_cast<std::size_t>(contactor.index)];
    block.port_impulse.segment<6>(port - block.offset) += F;
  };
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const ContactConstraint& c = constraints_[i];
    if (c.port_a >= 0)
      add(c.port_a, contactors_[static_cast<std::size_t>(points_[i].body_a)], c.J_a.transpose() * c.impulse);
    if (c.port_b >= 0)
      add(c.port_b, contactors_[static_cast<std::size_t>(points_[i].body_b)], c.J_b.transpose() * c.impulse);
  }
  std::size_t next = 0;
  for (std::size_t i = 0; i < mechanisms_.size(); ++i) {
    MechanismBlock& block = mechanism_blocks_[i];
    for (std::size_t k = 0; k < block.limits.size(); ++k, ++next) {
      block.port_impulse(limits_[next].row - block.offset) += limits_[next].sign * limits_[next].impulse;
      block.limit_impulses[static_cast<std::size_t>(block.limits[k])] = limits_[next].impulse;
    }
    if (block.rows == 0) continue;
    block.impulse.noalias() = block.J_T.leftCols(block.rows) * block.port_impulse.head(block.rows);
    mechanisms_[i].ApplyImpulse(block.impulse);
  }
  for (std::size_t c = 0; c < contactors_.size(); ++c)
    if (contactors_[c].kind == Contactor::Kind::kFreeBody && port_offset_[c] >= 0)
      free_bodies_[static_cast<std::size_t>(contactors_[c].index)].SetPortTwist(
          velocities_.segment<6>(port_offset_[c]));
}

void World::KeepForNextStep(StepReport& report) {
  contacts_.resize(points_.size());
  normal_speed_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const ContactConstraint& c = constraints_[i];
    contacts_[i].point = points_[i];
    contacts_[i].impulse = c.impulse;
    contacts_[i].friction = c.friction;
    double speed = 0;
    if (c.port_a >= 0) speed += c.J_a.row(0).dot(velocities_.segment<6>(c.port_a));
    if (c.port_b >= 0) speed += c.J_b.row(0).dot(velocities_.segment<6>(c.port_b));
    normal_speed_[i] = speed;
    if (c.impulse(0) > 0) {
      ++report.contacts;
      report.max_penetration = std::max(report.max_penetration, -points_[i].gap);
    }
  }
  for (const LimitConstraint& limit : limits_) report.limits += limit.impulse > 0 ? 1 : 0;
  previous_ = contacts_;
  previous_normal_speed_ = normal_speed_;
}

}  // namespace fork1s
