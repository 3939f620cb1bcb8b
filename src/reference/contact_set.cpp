#include "contact_set.hpp"

#include <algorithm>
#include <cmath>

#include "contact_compliance.hpp"
#include "dense_contact_solver.hpp"
#include "restitution.hpp"

namespace fork1s::internal {

using reference::BoundConstraint;
using reference::PointConstraint;
using reference::PointJacobian;

void ContactSet::AssignPorts(const Mechanisms& mechanisms, const Bodies& free_bodies, double h) {
  std::fill(port_offset_.begin(), port_offset_.end(), -1);
  std::vector<char> touched(collision_bodies_.size(), 0);
  for (const ContactPoint& p : points_)
    touched[static_cast<std::size_t>(p.body_a)] = touched[static_cast<std::size_t>(p.body_b)] = 1;
  int offset = 0;
  auto open = [&](std::vector<Port>& ports, FullCollisionBody::Kind kind, std::size_t index) {
    for (std::size_t c = 0; c < collision_bodies_.size(); ++c) {
      const FullCollisionBody& collision_body = collision_bodies_[c];
      if (!touched[c] || collision_body.kind != kind ||
          static_cast<std::size_t>(collision_body.index) != index)
        continue;
      ports.push_back({static_cast<int>(c), offset});
      port_offset_[c] = offset;
      offset += 6;
    }
  };
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const FullMechanism& m = mechanisms[i];
    Block& block = blocks_[i];
    block.offset = offset;
    block.ports.clear();
    block.limits.clear();
    open(block.ports, FullCollisionBody::Kind::kMechanism, i);
    for (int k = 0; k < static_cast<int>(m.length_limits().size()); ++k) {
      const Mechanism::LengthLimit& limit = m.length_limits()[static_cast<std::size_t>(k)];
      const double length = m.Length(limit.length, m.q());
      // Near enough to be reached within the step, with room for what contacts may add.
      const double reach = 0.02 + 2 * h * std::abs(m.LengthRate(limit.length, m.q(), m.q_dot()));
      const double gap[2] = {length - limit.lower, limit.upper - length};
      for (int side = 0; side < 2; ++side) {
        if (gap[side] < reach)
          block.limits.push_back(2 * k + side);
        else
          block.limit_impulses[static_cast<std::size_t>(2 * k + side)] = 0;
      }
    }
    offset += static_cast<int>(block.limits.size() + m.mechanism().frictions().size());
    block.rows = offset - block.offset;
  }
  free_ports_.clear();
  for (std::size_t i = 0; i < free_bodies.size(); ++i)
    open(free_ports_, FullCollisionBody::Kind::kFreeBody, i);
  velocities_.setZero(offset);
  FillVelocities(mechanisms, free_bodies, false, velocities_);
}

void ContactSet::FillVelocities(const Mechanisms& mechanisms, const Bodies& free_bodies, bool at_guess,
                                VectorX& velocities) const {
  for (std::size_t c = 0; c < collision_bodies_.size(); ++c) {
    if (port_offset_[c] < 0) continue;
    const auto at = static_cast<std::size_t>(collision_bodies_[c].index);
    const int body = collision_bodies_[c].body;
    velocities.segment<6>(port_offset_[c]) =
        collision_bodies_[c].kind == FullCollisionBody::Kind::kFreeBody
            ? (at_guess ? free_bodies[at].NextPortTwist() : free_bodies[at].PortTwist())
            : InAxes(PoseOf(collision_bodies_[c], mechanisms, free_bodies, at_guess).rotation(),
                     at_guess ? mechanisms[at].NextTwist(body) : mechanisms[at].BodyTwist(body));
  }
}

RigidTransform ContactSet::PoseOf(const FullCollisionBody& collision_body, const Mechanisms& mechanisms,
                                  const Bodies& free_bodies, bool at_guess) const {
  const auto at = static_cast<std::size_t>(collision_body.index);
  if (collision_body.kind == FullCollisionBody::Kind::kFreeBody)
    return at_guess ? free_bodies[at].NextPose() : free_bodies[at].pose();
  return at_guess ? mechanisms[at].NextPose(collision_body.body) : mechanisms[at].Pose(collision_body.body);
}

const ContactSet::Past* ContactSet::FindPast(const ContactPoint& point) {
  double best = 0.02;  // m; a point that moved farther in a step is another contact
  int found = -1;
  for (std::size_t k = 0; k < past_.size(); ++k) {
    const ContactPoint& o = past_[k].point;
    if (past_used_[k] || o.body_a != point.body_a || o.body_b != point.body_b ||
        o.geometry_a != point.geometry_a || o.geometry_b != point.geometry_b)
      continue;
    const double distance = (o.point - point.point).norm();
    if (distance < best && o.frame.row(0).dot(point.frame.row(0)) > 0.8) {
      best = distance;
      found = static_cast<int>(k);
    }
  }
  if (found < 0) return nullptr;
  past_used_[static_cast<std::size_t>(found)] = 1;
  return &past_[static_cast<std::size_t>(found)];
}

// Relative velocity in the contact's frame.
Vector3 ContactSet::Speed(const PointConstraint& c) const {
  Vector3 speed = Vector3::Zero();
  if (c.port_a >= 0) speed += c.J_a * velocities_.segment<6>(c.port_a);
  if (c.port_b >= 0) speed += c.J_b * velocities_.segment<6>(c.port_b);
  return speed;
}

void ContactSet::AddRows(const Bodies& free_bodies, const Mechanisms& mechanisms, double h,
                         const FullSimulationOptions& options) {
  constraints_.assign(points_.size(), PointConstraint{});
  const reference::ContactCompliance compliance = reference::ComputeContactCompliance(options.material, h);
  past_used_.assign(past_.size(), 0);
  approach_.assign(points_.size(), 0.0);
  bias_.resize(points_.size());
  start_speed_.assign(points_.size(), 0.0);
  gap_.assign(points_.size(), 0.0);
  bore_.assign(points_.size(), 0);
  fresh_.assign(points_.size(), 0);
  bounces_.assign(points_.size(), 0);
  VectorX guess = VectorX::Zero(velocities_.size());
  if (at_guess_) FillVelocities(mechanisms, free_bodies, true, guess);
  // Impulses are those of a step's length.
  const double longer = past_h_ > 0 ? h / past_h_ : 1;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const ContactPoint& p = points_[i];
    PointConstraint& c = constraints_[i];
    c.friction = p.friction;
    c.torsion = p.torsion;
    c.rolling = p.rolling;
    c.friction_scale = p.friction_scale;
    c.spin = p.surface_velocity[0];
    c.bias.tail<2>() = p.surface_velocity.tail<2>();
    Vector3 speed = Vector3::Zero();
    double guessed = 0;
    auto side = [&](int body, double sign, int& port, PointJacobian& J) {
      const FullCollisionBody& collision_body = collision_bodies_[static_cast<std::size_t>(body)];
      if (collision_body.kind == FullCollisionBody::Kind::kWorld) return;
      port = port_offset_[static_cast<std::size_t>(body)];
      const auto at = static_cast<std::size_t>(collision_body.index);
      const RigidTransform X = PoseOf(collision_body, mechanisms, free_bodies, at_guess_);
      const Vector3 center = collision_body.kind == FullCollisionBody::Kind::kFreeBody
                                 ? free_bodies[at].CenterAt(X)
                                 : X.translation();
      J.rightCols<3>() = sign * p.frame;
      J.leftCols<3>() = -sign * p.frame * Skew(p.point - center);
      speed += J * velocities_.segment<6>(port);
      guessed += J.row(0).dot(guess.segment<6>(port));
    };
    side(p.body_a, -1, c.port_a, c.J_a);
    side(p.body_b, 1, c.port_b, c.J_b);
    const Past* past = FindPast(p);
    // At the guess the gap of the start is what these rows would make of the end's.
    gap_[i] = p.gap - h * guessed;
    start_speed_[i] = speed(0);
    c.compliance_normal = compliance.normal;
    c.compliance_tangent = compliance.tangent;
    c.hardening_speed = compliance.hardening_speed;
    c.bias[0] = reference::ComputeGapBias(options.material, gap_[i], h);
    if (past) {
      c.previous_impulse = c.impulse = p.frame * (past->point.frame.transpose() * (longer * past->impulse));
      c.previous_utilization = past->utilization;
      c.previous_moment = c.moment = p.frame * (past->point.frame.transpose() * (longer * past->moment));
      // As its own rows saw it: how far a normal turns within the step is no approach.
      start_speed_[i] = past->point.frame.row(0).dot(past->speed_W);
      bore_[i] = past->impulse(0) > 0;
      fresh_[i] = past->fresh;
      // (h/2) J̇ V by difference: the same velocity seen by this step's rows and by the last one's.
      if (options.contact_curvature && past->impulse(0) > 0 && !stage_)
        c.bias += 0.5 * (speed - p.frame * past->speed_W);
    }
    if (p.restitution > 0) approach_[i] = std::max(0.0, -speed(0));
    bias_[i] = c.bias[0];
  }
  limits_.clear();
  limit_gap_.clear();
  limit_speed_.clear();
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const FullMechanism& m = mechanisms[i];
    for (std::size_t k = 0; k < blocks_[i].limits.size(); ++k) {
      const int at = blocks_[i].limits[k];
      const Mechanism::LengthLimit& stop = mechanisms[i].length_limits()[static_cast<std::size_t>(at / 2)];
      const bool upper = at % 2 == 1;
      const double length = at_guess_ ? m.Length(stop.length, m.next_q()) -
                                            h * m.LengthRate(stop.length, m.next_q(), m.next_q_dot())
                                      : m.Length(stop.length, m.q());
      BoundConstraint limit;
      limit.row = blocks_[i].offset + 6 * static_cast<int>(blocks_[i].ports.size()) + static_cast<int>(k);
      limit.sign = upper ? -1 : 1;
      limit_gap_.push_back(upper ? stop.upper - length : length - stop.lower);
      limit_speed_.push_back(limit.sign * m.LengthRate(stop.length, m.q(), m.q_dot()));
      limit.bias = reference::ComputeGapBias(options.material, limit_gap_.back(), h);
      const double arm = m.mechanism().IsTendon(stop.length)  ? 1 / stop.length.gear
                         : m.mechanism().IsAngle(stop.length) ? m.mechanism().length_scale()
                                                              : 1;
      limit.recovery_mass = m.mechanism().total_mass() * arm * arm;
      limit.impulse = longer * blocks_[i].limit_impulses[static_cast<std::size_t>(at)];
      limits_.push_back(limit);
    }
    const auto& frictions = mechanisms[i].mechanism().frictions();
    for (std::size_t k = 0; k < frictions.size(); ++k) {
      BoundConstraint friction;
      friction.row =
          blocks_[i].offset + static_cast<int>(6 * blocks_[i].ports.size() + blocks_[i].limits.size() + k);
      friction.upper = h * frictions[k].force;
      friction.lower = -friction.upper;
      friction.previous_impulse = friction.impulse = longer * blocks_[i].friction_impulses[k];
      limits_.push_back(friction);
    }
  }
}

void ContactSet::Open(const Mechanisms& mechanisms, const Bodies& free_bodies, double h,
                      const FullSimulationOptions& options) {
  h_ = h;
  at_guess_ = stage_ = false;
  AssignPorts(mechanisms, free_bodies, h);
  AddRows(free_bodies, mechanisms, h, options);
}

void ContactSet::ClearImpulses() {
  for (PointConstraint& c : constraints_) {
    c.impulse.setZero();
    c.moment.setZero();
  }
  for (BoundConstraint& limit : limits_) limit.impulse = 0;
}

bool ContactSet::Solve(const Mechanisms& mechanisms, const Bodies& free_bodies,
                       const FullContactOptions& options, FullContactReport& report) {
  std::vector<reference::ResponseBlock> response_blocks;
  std::vector<MatrixX> responses(mechanisms.size());
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const FullMechanism& m = mechanisms[i];
    Block& block = blocks_[i];
    block.unknowns = m.free_unknowns();
    if (block.rows == 0) continue;
    block.J_T.setZero(m.num_unknowns(), block.rows);
    for (const Port& port : block.ports) {
      const int body = collision_bodies_[static_cast<std::size_t>(port.collision_body)].body,
                column = m.ColumnOfBody(body);
      if (column < 0) {
        velocities_.segment<6>(port.offset) = InAxes(m.NextPose(body).rotation(), m.NextTwist(body));
        continue;
      }
      const Matrix3 R_T = m.NextPose(body).rotation().transpose();
      block.J_T.block<3, 3>(column, port.offset - block.offset) = R_T;
      block.J_T.block<3, 3>(column + 3, port.offset + 3 - block.offset) = R_T;
    }
    // Lengths as where their gaps were taken.
    const auto add_length = [&](const Mechanism::Length& length, std::size_t row) {
      m.ForEachArmAt(length, at_guess_ ? m.next_q() : m.q(), [&](int coordinate, double c) {
        block.J_T(m.ColumnOfCoordinate(coordinate), static_cast<Eigen::Index>(row)) += c;
      });
    };
    for (std::size_t k = 0; k < block.limits.size(); ++k)
      add_length(m.length_limits()[static_cast<std::size_t>(block.limits[k] / 2)].length,
                 6 * block.ports.size() + k);
    const auto& frictions = m.mechanism().frictions();
    for (std::size_t k = 0; k < frictions.size(); ++k)
      add_length(frictions[k].length, 6 * block.ports.size() + block.limits.size() + k);
    responses[i] = block.J_T;
    if (!m.solver().Solve(responses[i])) return false;
    block.W = block.J_T.transpose() * responses[i];
    block.W = (0.5 * (block.W + block.W.transpose())).eval();
    const VectorX v = block.J_T.transpose() * block.unknowns;
    for (const Port& port : block.ports)
      if (m.ColumnOfBody(collision_bodies_[static_cast<std::size_t>(port.collision_body)].body) >= 0)
        velocities_.segment<6>(port.offset) = v.segment<6>(port.offset - block.offset);
    const auto limits = static_cast<Eigen::Index>(block.limits.size() + frictions.size());
    velocities_.segment(block.offset + block.rows - limits, limits) = v.tail(limits);
    response_blocks.push_back({block.offset, block.W});
  }
  free_twists_.resize(free_bodies.size());
  for (std::size_t i = 0; i < free_bodies.size(); ++i) free_twists_[i] = free_bodies[i].FreePortTwist();
  for (const Port& port : free_ports_) {
    const auto i =
        static_cast<std::size_t>(collision_bodies_[static_cast<std::size_t>(port.collision_body)].index);
    velocities_.segment<6>(port.offset) = free_twists_[i];
    response_blocks.push_back({port.offset, free_bodies[i].InverseInertia()});
  }
  pushes_mechanism_.assign(mechanisms.size(), 0);
  pushes_free_body_.assign(free_bodies.size(), 0);
  if (empty()) return true;

  for (std::size_t i = 0; i < points_.size(); ++i) {
    PointConstraint& c = constraints_[i];
    const Vector3 speed = Speed(c);
    const double rebound =
        reference::ComputeReboundSpeed(points_[i].restitution, approach_[i], speed(0), gap_[i], h_);
    bounces_[i] = rebound > 0;
    c.bias[0] = rebound > 0 ? -rebound : bias_[i];
  }
  report = reference::SolveContacts(response_blocks, constraints_, limits_, velocities_, options);
  VectorX impulses = VectorX::Zero(velocities_.size());
  for (const PointConstraint& c : constraints_) {
    if (c.port_a >= 0) impulses.segment<6>(c.port_a) += c.ImpulseOn(c.J_a);
    if (c.port_b >= 0) impulses.segment<6>(c.port_b) += c.ImpulseOn(c.J_b);
  }
  for (const BoundConstraint& limit : limits_) impulses(limit.row) += limit.sign * limit.impulse;
  for (std::size_t i = 0; i < mechanisms.size(); ++i)
    if (blocks_[i].rows > 0)
      blocks_[i].unknowns += responses[i] * impulses.segment(blocks_[i].offset, blocks_[i].rows);
  // Limits and self-contact are a mechanism's own affair: its base has no gap to keep for them.
  for (std::size_t k = 0; k < constraints_.size(); ++k) {
    if (constraints_[k].impulse.isZero(0)) continue;
    const FullCollisionBody& a = collision_bodies_[static_cast<std::size_t>(points_[k].body_a)];
    const FullCollisionBody& b = collision_bodies_[static_cast<std::size_t>(points_[k].body_b)];
    const bool own = a.kind == b.kind && a.index == b.index;
    for (const FullCollisionBody* side : {&a, &b})
      if (side->kind == FullCollisionBody::Kind::kMechanism && !own)
        pushes_mechanism_[static_cast<std::size_t>(side->index)] = 1;
  }
  for (const Port& port : free_ports_)
    pushes_free_body_[static_cast<std::size_t>(
        collision_bodies_[static_cast<std::size_t>(port.collision_body)].index)] =
        !impulses.segment<6>(port.offset).isZero(0);
  for (const Port& port : free_ports_)
    free_twists_[static_cast<std::size_t>(
        collision_bodies_[static_cast<std::size_t>(port.collision_body)].index)] =
        velocities_.segment<6>(port.offset);
  return true;
}

Matrix6X ContactSet::OnBodies(std::size_t i, const FullMechanism& mechanism) const {
  Matrix6X out = Matrix6X::Zero(6, mechanism.mechanism().num_bodies());
  for (std::size_t k = 0; k < constraints_.size(); ++k) {
    const PointConstraint& c = constraints_[k];
    auto add = [&](int body, const PointJacobian& J) {
      const FullCollisionBody& collision_body = collision_bodies_[static_cast<std::size_t>(body)];
      if (collision_body.kind != FullCollisionBody::Kind::kMechanism ||
          static_cast<std::size_t>(collision_body.index) != i)
        return;
      const Matrix3 R_T = mechanism.NextPose(collision_body.body).rotation().transpose();
      const Vector6 F = c.ImpulseOn(J);
      out.col(collision_body.body).head<3>() += R_T * F.head<3>();
      out.col(collision_body.body).tail<3>() += R_T * F.tail<3>();
    };
    add(points_[k].body_a, c.J_a);
    add(points_[k].body_b, c.J_b);
  }
  return out;
}

void ContactSet::Close(double h, FullStepReport& report, std::vector<FullContact>& contacts) {
  past_.clear();
  past_h_ = h;
  contacts.clear();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const PointConstraint& c = constraints_[i];
    const Vector3 speed = Speed(c);
    past_.push_back(
        {points_[i], c.impulse, c.moment, points_[i].frame.transpose() * speed, c.utilization, false});
    FullContact& out = contacts.emplace_back();
    out.point = points_[i];
    out.point.body_a = collision_bodies_[static_cast<std::size_t>(points_[i].body_a)].scene_body;
    out.point.body_b = collision_bodies_[static_cast<std::size_t>(points_[i].body_b)].scene_body;
    out.force = points_[i].frame.transpose() * c.impulse / h;
    if (c.impulse(0) > 0) {
      ++report.contacts;
      report.max_penetration = std::max(report.max_penetration, -gap_[i]);
    }
  }
  std::size_t next = 0;
  for (Block& block : blocks_) {
    for (int at : block.limits) {
      block.limit_impulses[static_cast<std::size_t>(at)] = limits_[next].impulse;
      report.limits += limits_[next++].impulse > 0 ? 1 : 0;
    }
    for (double& impulse : block.friction_impulses) impulse = limits_[next++].impulse;
  }
}

}  // namespace fork1s::internal
