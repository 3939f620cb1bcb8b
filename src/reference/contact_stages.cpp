// Contacts within a step of two stages.
#include <algorithm>
#include <cmath>

#include "contact_set.hpp"

namespace fork1s::internal {

bool ContactSet::OpenStage(const Mechanisms& mechanisms, const Bodies& free_bodies, double h, double part,
                           const Vector3& gravity_W, const FullSimulationOptions& options, bool at_guess) {
  // What can close within the part: twice what the present twists make of it, gravity, and a millimetre.
  double speed = 0;
  for (std::size_t i = 0; i < collision_bodies_.size(); ++i) {
    const FullCollisionBody& c = collision_bodies_[i];
    if (c.kind == FullCollisionBody::Kind::kWorld) continue;
    const auto at = static_cast<std::size_t>(c.index);
    collision_->SetPose(static_cast<int>(i), PoseOf(c, mechanisms, free_bodies, at_guess));
    previous_pose_[i] = PoseOf(c, mechanisms, free_bodies, false);
    Vector6 V = c.kind == FullCollisionBody::Kind::kFreeBody ? free_bodies[at].PortTwist()
                                                             : mechanisms[at].BodyTwist(c.body);
    speed = std::max(speed, V.tail<3>().norm() + V.head<3>().norm() * c.radius);
  }
  has_previous_pose_ = true;
  collision_->SetMargin(std::min(margin_max_, 0.001 + 2 * speed * part + gravity_W.norm() * part * part));
  const bool complete = collision_->Detect(points_);
  h_ = h;
  stage_ = true;
  at_guess_ = at_guess;
  AssignPorts(mechanisms, free_bodies, part);
  AddRows(free_bodies, mechanisms, h, options);
  return complete;
}

bool ContactSet::HasImpact(const Mechanisms& mechanisms, double part, double speed, bool second) const {
  for (std::size_t i = 0; i < constraints_.size(); ++i) {
    const reference::PointConstraint& c = constraints_[i];
    if (bounces_[i]) return true;
    const double now = Speed(c)(0);
    const bool bears = c.impulse(0) > 0;
    if (bears && !bore_[i] && -start_speed_[i] > speed) return true;
    if (!bears && !second && -now > speed && gap_[i] + part * now < 0) return true;
    if (!bears && second && fresh_[i] && now > speed) return true;
  }
  std::size_t row = 0, next = 0;
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const Block& block = blocks_[i];
    const double L = mechanisms[i].mechanism().length_scale();
    for (std::size_t k = 0; k < block.limits.size(); ++k) {
      const reference::BoundConstraint& limit = limits_[row++];
      // Turns count by what they move, and lengths of tendons and slides no less than that.
      const double unit = std::min(1.0, L), now = limit.sign * velocities_(limit.row);
      const bool bears = limit.impulse > 0;
      const auto at = static_cast<std::size_t>(block.limits[k]);
      if (bears && block.limit_impulses[at] == 0 && -limit_speed_[next] * unit > speed) return true;
      if (!bears && second && limit_fresh_[i][at] && now * unit > speed) return true;
      if (!bears && !second && -now * unit > speed && limit_gap_[next] + part * now < 0) return true;
      ++next;
    }
    row += block.friction_impulses.size();
  }
  return false;
}

void ContactSet::CloseStage(double h, double speed, FullStepReport& report,
                            std::vector<FullContact>& contacts) {
  std::size_t row = 0, next = 0;
  limit_fresh_.resize(blocks_.size());
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const Block& block = blocks_[i];
    limit_fresh_[i].assign(block.limit_impulses.size(), 0);
    for (int at : block.limits) {
      const auto k = static_cast<std::size_t>(at);
      limit_fresh_[i][k] =
          limits_[row++].impulse > 0 && (block.limit_impulses[k] == 0 || -limit_speed_[next] > speed);
      ++next;
    }
    row += block.friction_impulses.size();
  }
  FullStepReport counted;
  Close(h, counted, contacts);
  report.limits = std::max(report.limits, counted.limits);
  report.max_penetration = std::max(report.max_penetration, counted.max_penetration);
  for (std::size_t i = 0; i < past_.size(); ++i)
    past_[i].fresh = past_[i].impulse(0) > 0 && (!bore_[i] || -start_speed_[i] > speed);
}

ContactSet::Memory ContactSet::Save() const {
  Memory memory{past_, past_h_, previous_pose_, {}, {}};
  for (const Block& block : blocks_) {
    memory.limit_impulses.push_back(block.limit_impulses);
    memory.friction_impulses.push_back(block.friction_impulses);
  }
  return memory;
}

void ContactSet::Restore(const Memory& memory) {
  past_ = memory.past;
  past_h_ = memory.past_h;
  previous_pose_ = memory.previous_pose;
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    blocks_[i].limit_impulses = memory.limit_impulses[i];
    blocks_[i].friction_impulses = memory.friction_impulses[i];
  }
}

}  // namespace fork1s::internal
