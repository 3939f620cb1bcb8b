// The rows of contacts and stops.
#include <algorithm>
#include <cmath>
#include <limits>

#include "world_detail.hpp"

namespace fork1s {
namespace {

constexpr double kNoGap = std::numeric_limits<double>::quiet_NaN();

}  // namespace

// The frames that the twists of ports are given in and about: of mechanisms their root, of free bodies world
// axes at their centre of mass. Every contact asks for those of its two sides several times.
void World::Detail::FindPortFrames() {
  port_frames_.resize(contactors_.size());
  for (std::size_t c = 0; c < contactors_.size(); ++c) {
    if (port_offset_[c] < 0) continue;
    const auto i = static_cast<std::size_t>(contactors_[c].index);
    port_frames_[c] = contactors_[c].kind == Contactor::Kind::kFreeBody
                          ? RigidTransform(Matrix3::Identity(), free_bodies_[i].center_W())
                          : mechanisms_[i].state().X_WR;
  }
}

// Rows of the contact frame on the twist of a port. `ahead`: as many seconds later, by the velocities at hand.
Matrix36 World::Detail::PortRows(int contactor, const Vector3& point, const Matrix3& frame,
                                 double ahead) const {
  const auto c = static_cast<std::size_t>(contactor);
  const auto i = static_cast<std::size_t>(contactors_[c].index);
  const bool is_free = contactors_[c].kind == Contactor::Kind::kFreeBody;
  const RigidTransform* X_WP = &port_frames_[c];
  RigidTransform later;
  if (ahead > 0 && !is_free && mechanisms_[i].mechanism().base() == BaseKind::kDriven) {
    later = *X_WP * Exp(ahead * mechanism_blocks_[i].V_R_foreseen);
    X_WP = &later;
  }
  Vector3 p = point - X_WP->translation();
  Matrix36 J;
  if (is_free) {  // in world axes
    if (ahead > 0) p -= ahead * velocities_.segment<3>(port_offset_[c] + 3);
    J.rightCols<3>() = frame;
  } else {
    p = X_WP->rotation().transpose().lazyProduct(p).eval();
    J.rightCols<3>() = frame.lazyProduct(X_WP->rotation());
  }
  for (int k = 0; k < 3; ++k)
    J.row(k).head<3>() = p.cross(Vector3(J.row(k).tail<3>().transpose())).transpose();
  return J;
}

// Of a body's material at a point, by velocities stacked as velocities_ are.
MaterialMotion World::Detail::MotionAt(int contactor, const Vector3& point, const VectorX& velocities) const {
  const auto c = static_cast<std::size_t>(contactor);
  if (contactors_[c].kind == Contactor::Kind::kWorld) return {};
  const RigidTransform& X_WP = port_frames_[c];
  const auto V = velocities.segment<6>(port_offset_[c]);
  const Vector3 omega = X_WP.rotation().lazyProduct(V.head<3>());
  return {omega, X_WP.rotation().lazyProduct(V.tail<3>()) + omega.cross(point - X_WP.translation())};
}

// Its coordinates are about another reference than in the step before.
bool World::Detail::Reparametrised(int contactor) const {
  const Contactor& c = contactors_[static_cast<std::size_t>(contactor)];
  return c.kind == Contactor::Kind::kGroup &&
         mechanism_blocks_[static_cast<std::size_t>(c.index)].refreshed > 0;
}

// (h/2) J dG/dt ẏ where G, of the pose of a mechanism, takes its coordinates ẏ to the twist of a port: the
// same coordinates gave another twist at the end of the last step.
Vector3 World::Detail::CoordinateCurvature(int contactor, const Matrix36& J) const {
  const auto c = static_cast<std::size_t>(contactor);
  if (contactors_[c].kind != Contactor::Kind::kGroup || Reparametrised(contactor)) return Vector3::Zero();
  return 0.5 * (J * (velocities_.segment<6>(port_offset_[c]) - last_twist_[c]));
}

// How a contact moves by the velocities at hand; false where the shapes do not tell, and on a
// floating base, whose frame drifts with the centre of mass but turns with the base: no one frame half way is
// that of all its rows.
bool World::Detail::Foresee(const ContactPoint& p, Foresight& out) const {
  const auto a = static_cast<std::size_t>(p.body_a), b = static_cast<std::size_t>(p.body_b);
  for (const std::size_t side : {a, b})
    if (const Contactor& c = contactors_[side];
        c.kind == Contactor::Kind::kGroup &&
        mechanisms_[static_cast<std::size_t>(c.index)].mechanism().base() == BaseKind::kFloating)
      return false;
  out.curvature = CurvatureOf(geometries_[a][static_cast<std::size_t>(p.geometry_a)], contactor_pose_[a],
                              geometries_[b][static_cast<std::size_t>(p.geometry_b)], contactor_pose_[b], p);
  if (!out.curvature.known) return false;
  out.inverse = InverseOf(out.curvature);
  out.frame = p.frame;
  out.motion = MotionBy(change_, p, out);
  return true;
}

// The rows of a contact where it will be after `ahead` seconds, foreseen or 0, and its axes there.
Matrix3 World::Detail::SetRows(const ContactPoint& found, const Foresight& seen, double ahead,
                               ContactConstraint& c) const {
  Vector3 point = found.point;
  Matrix3 frame = found.frame;
  if (ahead > 0) {
    point += ahead * seen.motion.velocity;
    frame = found.frame.lazyProduct(ExpRotation(ahead * seen.motion.omega).transpose());
  }
  if (c.port_a >= 0) c.J_a = -PortRows(found.body_a, point, frame, ahead);
  if (c.port_b >= 0) c.J_b = PortRows(found.body_b, point, frame, ahead);
  return frame;
}

ContactMotion World::Detail::MotionBy(const VectorX& velocities, const ContactPoint& p,
                                      const Foresight& seen) const {
  // The point stands midway; what rolls are the surfaces.
  const Vector3 to_b = 0.5 * p.gap * seen.frame.row(0).transpose();
  return MotionOf(seen.curvature, seen.inverse, seen.frame, MotionAt(p.body_a, p.point - to_b, velocities),
                  MotionAt(p.body_b, p.point + to_b, velocities));
}

// How far [m, world axes] what sticks goes along the surface since the velocities of the start, and not those
// of the end, said where half way is. The next step makes it good: left alone, it comes to nothing where
// things go to and fro on one path, but in circles it adds up, and a ball that is shaken crept by 0.2 mm.
Vector3 World::Detail::MissedWay(double h, std::size_t contact, const VectorX& mean) const {
  const ContactConstraint& c = constraints_[contact];
  const ContactPoint& p = points_[contact];
  const Foresight& seen = foresight_[contact];
  if (!seen.used || !(c.impulse(0) > 0)) return Vector3::Zero();
  // Motions are linear in velocities: how much farther the point goes, and beside it what the arms end at.
  const Vector3 farther = MotionBy(change_, p, seen).velocity;
  const auto slip = [&](int body) -> Vector3 {
    const auto k = static_cast<std::size_t>(body);
    const Contactor& touching = contactors_[k];
    if (touching.kind == Contactor::Kind::kWorld) return Vector3::Zero();
    const auto V = mean.segment<6>(port_offset_[k]);
    if (touching.kind == Contactor::Kind::kFreeBody)
      return V.head<3>().cross(farther - change_.segment<3>(port_offset_[k] + 3));
    const auto i = static_cast<std::size_t>(touching.index);
    const ReducedState& state = mechanisms_[i].state();
    const Matrix3& R = state.X_WR.rotation();
    const Vector3 omega = R * V.head<3>();
    if (mechanisms_[i].mechanism().base() != BaseKind::kDriven) return omega.cross(farther);
    // The frame of the base, which V is given in, turns and moves on with the change of its own twist.
    const Vector6 base = state.V_R - mechanism_blocks_[i].V_R_foreseen;
    const Vector3 turn = R * base.head<3>();
    return turn.cross(R * V.tail<3>()) + turn.cross(omega).cross(p.point - state.X_WR.translation()) +
           omega.cross(farther - R * base.tail<3>());
  };
  const Vector3 missed = 0.5 * h * h * (slip(p.body_b) - slip(p.body_a));
  const Vector3 n = p.frame.row(0).transpose();
  const double sticks = c.use > 1 ? 1 / c.use : 1;  // as much as the law leaves of what would hold it
  return sticks * (missed - n * n.dot(missed));     // along the normal the gap says it
}

Vector3 World::Detail::RelativeSpeed(const ContactConstraint& c, const VectorX& velocities) {
  Vector3 speed = Vector3::Zero();
  if (c.port_a >= 0) speed += c.J_a * velocities.segment<6>(c.port_a);
  if (c.port_b >= 0) speed += c.J_b * velocities.segment<6>(c.port_b);
  return speed;
}

// How far from half way to the end rows may go ahead. A force N that turns with a surface of curvature κ is a
// spring of stiffness N κ, which rows that go ahead by velocities of the start take explicitly: a mass m bears
// that up to some m/h², of which this leaves a quarter. What a mechanism holds it may press with any force.
double World::Detail::ShareOfEnd(std::size_t i, double h) const {
  const ContactPoint& p = points_[i];
  double mass = std::numeric_limits<double>::infinity();
  for (const int body : {p.body_a, p.body_b}) {
    const Contactor& c = contactors_[static_cast<std::size_t>(body)];
    if (c.kind == Contactor::Kind::kGroup) return 0;
    if (c.kind == Contactor::Kind::kFreeBody)
      mass = std::min(mass, free_bodies_[static_cast<std::size_t>(c.index)].inertia().mass);
  }
  const PairCurvature& curvature = foresight_[i].curvature;
  const double force = previous_[static_cast<std::size_t>(match_[i])].impulse(0) / previous_h_;
  const double stiffness = force * (curvature.a + curvature.b).norm();
  return std::min(1.0, 0.25 * mass / (h * h * stiffness));
}

// What turns an impulse of the last step into one of this step.
double World::Detail::StepsRatio(double h) const { return previous_h_ > 0 ? h / previous_h_ : 1; }

// The rows of a contact, and what they know of the last step.
void World::Detail::AssembleContact(std::size_t i, const StepOptions& options) {
  const double h = options.h;
  ContactPoint& p = points_[i];
  ContactConstraint& c = constraints_[i];
  c = ContactConstraint{};
  c.friction = p.friction;
  c.torsion = p.torsion;
  c.rolling = p.rolling;
  const Contactor& a = contactors_[static_cast<std::size_t>(p.body_a)];
  const Contactor& b = contactors_[static_cast<std::size_t>(p.body_b)];
  if (a.kind != Contactor::Kind::kWorld) c.port_a = port_offset_[static_cast<std::size_t>(p.body_a)];
  if (b.kind != Contactor::Kind::kWorld) c.port_b = port_offset_[static_cast<std::size_t>(p.body_b)];
  // What lasts has its rows half a step ahead, where they turn the velocity into the way of the step to
  // second order; and what rows hold back, forces along the same rows do no work on. By two steps forces act
  // at its end: rows are those of there as far as that is sure, and what is more of the way by them is foreseen.
  const bool lasts = options.contact_curvature && rule_ != StepRule::kMiddle && rule_ != StepRule::kStage && curvature_valid_ &&
                     match_[i] >= 0 && previous_[static_cast<std::size_t>(match_[i])].impulse(0) > 0;
  Foresight& seen = foresight_[i];
  const bool foreseen = seen.used = lasts && Foresee(p, seen);
  double ahead = foreseen ? 0.5 * h : 0;
  Matrix3 frame = SetRows(p, seen, ahead, c);
  Vector3 speed = RelativeSpeed(c, velocities_), way = speed;
  if (foreseen && rule_ == StepRule::kTwoSteps)
    if (const double share = ShareOfEnd(i, h); share > 0) {
      ahead += 0.5 * h * share;
      frame = SetRows(p, seen, ahead, c);
      speed = RelativeSpeed(c, velocities_);
    }
  p.frame = frame;
  // Half way stands what half a step of the old velocity has made of the gap that the start had.
  const bool middle = rule_ == StepRule::kMiddle, stage = rule_ == StepRule::kStage;
  if (middle) p.gap -= 0.5 * h * speed(0);
  // A stage finds contacts at the pose that the velocity at hand leads to: this is the gap at its base point.
  if (stage) p.gap -= h * speed(0);
  closing_[i] = std::max(0.0, -(from_stage_start_ ? RelativeSpeed(c, start_velocities_) : speed)(0));
  if (const double start_gap = StartGap(i); start_gap <= 0) p.gap = start_gap;
  SetMaterial(options.material, p.gap, h, c);
  // Of the two stages restitution would be extrapolated; a step that meets something that has it is halved. A stage of
  // backward Euler takes the approach from the velocity of its start, by the rows of its end.
  const bool backward_euler = stage && depth_ >= kMaxEventHalvings;
  if (p.restitution > 0 && !middle && (!stage || backward_euler))
    approach_[i] = std::max(0.0, backward_euler ? -RelativeSpeed(c, start_velocities_)(0) : -speed(0));
  // A body on the floor would fall upon all that is near, were nothing there to hold it: it goes on as it
  // did.
  c.waits = p.gap + h * speed(0) > kClear;
  if (match_[i] < 0) return;
  const auto k = static_cast<std::size_t>(match_[i]);
  const ContactRecord& before = previous_[k];
  c.waits = c.waits && before.impulse.isZero(0);
  // What surfaces bore was a force; impulses are those of a step, of two stages the mean of both.
  const double by_step = StepsRatio(h);
  const Matrix3 turned = p.frame * before.point.frame.transpose();
  c.held = c.impulse = two_stage_ ? Vector3(h * (turned * before.end_force)) : Vector3((by_step * turned) * before.impulse);
  c.held_use = before.use;
  c.held_moment = c.moment = two_stage_ ? Vector3(h * (turned * before.end_moment)) : Vector3((by_step * turned) * before.moment);
  if (foreseen) {
    c.bias += way - speed;
    c.bias += CoordinateCurvature(p.body_a, c.J_a) + CoordinateCurvature(p.body_b, c.J_b) +
              p.frame * previous_missed_W_[k] / h;
  } else if (lasts && !Reparametrised(p.body_a) && !Reparametrised(p.body_b)) {
    // (h/2) J̇ V by difference: the same velocity seen by this step's rows and by the last one's.
    c.bias += 0.5 * (speed - p.frame * previous_speed_W_[k]);
  }
}

// Linearized at the pose of a stage, the gap of a contact, stop or tendon that lasts would come back as an
// error of position: of first order, as the gap bends. By the gap at the start of the step, gap/(h + τ) of a
// stage is stable for τ above 0.71 of its length.
//
// A stage of backward Euler that closes a gap leaves the velocity of the chord; what it stops is stopped in
// the next one, along the rows of its end.
void World::Detail::RecordStops(double h, bool backward_euler) {
  for (std::size_t i = 0; i < mechanisms_.size(); ++i) {
    MechanismBlock& block = mechanism_blocks_[i];
    for (std::size_t at = 0; at < block.limit_impulses.size(); ++at) {
      block.stop_carried[at] = block.stop_is_fresh[at] = 0;
      block.stop_start_gap[at] = kNoGap;
      if (!(block.limit_impulses[at] > 0)) continue;
      const StopApproach a = ApproachOf(mechanisms_[i], mechanisms_[i].length_limits()[at / 2], at % 2 == 1);
      if (!backward_euler && !(a.speed < impact_speed_)) continue;
      block.stop_carried[at] = 1;
      block.stop_is_fresh[at] = h * a.speed > kPartingShare * a.size;
      block.stop_start_gap[at] = a.gap / a.scale;
    }
  }
}

// Contacts are those found at the start.
void World::Detail::RecordStartGaps() {
  for (std::size_t i = 0; i < points_.size(); ++i)
    if (Bore(i)) start_gap_[static_cast<std::size_t>(match_[i])] = points_[i].gap;
}

// After the first stage, whose contacts become previous_.
void World::Detail::CarryStartGaps() {
  next_start_gap_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) next_start_gap_[i] = StartGap(i);
  start_gap_.swap(next_start_gap_);
}

// m; NaN where a contact carried no load at the start of the two-stage step at hand.
double World::Detail::StartGap(std::size_t contact) const {
  if (rule_ != StepRule::kStage || match_[contact] < 0) return kNoGap;
  return start_gap_[static_cast<std::size_t>(match_[contact])];
}

void World::Detail::AssembleConstraints(const StepOptions& options) {
  constraints_.resize(points_.size());
  approach_.assign(points_.size(), 0.0);
  closing_.assign(points_.size(), 0.0);
  foresight_.resize(points_.size());
  change_ = velocities_;
  FindPortFrames();
  // Bases too go on as they did, though it is known how they are driven: what they hold does not know yet.
  for (std::size_t i = 0; i < mechanisms_.size(); ++i)
    if (mechanisms_[i].mechanism().base() == BaseKind::kDriven)
      mechanism_blocks_[i].V_R_foreseen = mechanisms_[i].state().V_R;
  ForContacts([&](std::size_t i) { AssembleContact(i, options); });
  AssembleLimits(options);
}

// Every mechanism's rows have their place before they are known, so that mechanisms fill them side by side.
void World::Detail::AssembleLimits(const StepOptions& options) {
  std::size_t count = 0;
  for (MechanismBlock& block : mechanism_blocks_) {
    block.first_limit = count;
    for (const PartBlock& part : block.parts) count += part.limits.size() + part.frictions.size();
  }
  limits_.assign(count, LimitConstraint());
  stop_approach_.assign(count, StopApproach());
  servos_.clear();
  ForMechanisms([&](std::size_t i) { FillLimits(i, options); });
}

void World::Detail::FillLimits(std::size_t i, const StepOptions& options) {
  const double h = options.h, by_step = StepsRatio(h);
  const MechanismDynamics& m = mechanisms_[i];
  const MechanismBlock& block = mechanism_blocks_[i];
  const bool is_stage = rule_ == StepRule::kStage;
  auto next = limits_.begin() + static_cast<std::ptrdiff_t>(mechanism_blocks_[i].first_limit);
  for (const PartBlock& part : mechanism_blocks_[i].parts) {
    for (std::size_t k = 0; k < part.limits.size(); ++k) {
      const auto at = static_cast<std::size_t>(part.limits[k]);
      const Mechanism::LengthLimit& stop = m.length_limits()[at / 2];
      const bool upper = at % 2 == 1;
      const double length = m.Length(stop.length);
      LimitConstraint& limit = *next++;
      limit.row = part.offset + static_cast<int>(6 * part.groups.size() + k);
      limit.sign = upper ? -1 : 1;
      const double share = rule_ == StepRule::kMiddle ? 0.5 : rule_ == StepRule::kStage ? 1 : 0;
      const double moved = share > 0 ? share * h * LengthRate(m, stop.length) : 0;
      const double gap = upper ? stop.upper - length + moved : length - moved - stop.lower;
      limit.bias = is_stage && block.stop_start_gap[at] <= 0
                       ? StopBias(options.material, block.stop_start_gap[at], h)
                       : StopBias(options.material, gap, h);
      limit.impulse = by_step * block.limit_impulses[at];
      // By two stages one that bore may have only closed its gap: what of the speed is left counts there too.
      if ((rule_ == StepRule::kTwoSteps || rule_ == StepRule::kStage || in_parts_) &&
          (two_stage_ || !(limit.impulse > 0))) {
        StopApproach& approach = stop_approach_[static_cast<std::size_t>(&limit - limits_.data())];
        approach = ApproachOf(m, stop, upper);
        approach.mechanism = static_cast<int>(i);
        approach.stop = static_cast<int>(at / 2);
        approach.base_gap = approach.scale * gap;
        approach.bore = is_stage && block.stop_carried[at];
      }
    }
    for (std::size_t k = 0; k < part.frictions.size(); ++k) {
      const auto at = static_cast<std::size_t>(part.frictions[k]);
      LimitConstraint& friction = *next++;
      friction.row = part.offset + static_cast<int>(part.FrictionRow(k));
      friction.upper = h * m.mechanism().frictions()[at].force;
      friction.lower = -friction.upper;
      friction.held = friction.impulse = by_step * mechanism_blocks_[i].friction_impulses[at];
    }
  }
}

// What is met within the step and has restitution parts again, once the free motion is known.
void World::Detail::Rebound(double h) {
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (approach_[i] == 0) continue;
    ContactConstraint& c = constraints_[i];
    double free_speed = 0;
    if (c.port_a >= 0) free_speed += c.J_a.row(0).dot(velocities_.segment<6>(c.port_a));
    if (c.port_b >= 0) free_speed += c.J_b.row(0).dot(velocities_.segment<6>(c.port_b));
    const double speed = ReboundSpeed(points_[i].restitution, approach_[i], free_speed, points_[i].gap, h);
    if (speed > 0) c.bias[0] = -speed;
  }
}

// Rows bound the mean velocity of the step. What it has beyond the velocities that are solved for is known
// once all is predicted.
void World::Detail::ShiftRows() {
  port_shift_.setZero(velocities_.size());
  for (std::size_t i = 0; i < mechanisms_.size(); ++i) {
    const MechanismDynamics& m = mechanisms_[i];
    for (std::size_t p = 0; p < mechanism_blocks_[i].parts.size() && p < m.step_model().parts.size(); ++p) {
      const PartBlock& part = mechanism_blocks_[i].parts[p];
      const VelocityRange& run = m.step_model().parts[p];
      if (part.rows > 0)
        port_shift_.segment(part.offset, part.rows).noalias() =
            part.J_T.leftCols(part.rows).transpose() * ContactShift(m).segment(run.begin, run.size);
    }
  }
  if (rule_ == StepRule::kTwoSteps)
    for (std::size_t c = 0; c < contactors_.size(); ++c)
      if (contactors_[c].kind == Contactor::Kind::kFreeBody && port_offset_[c] >= 0)
        port_shift_.segment<6>(port_offset_[c]) =
            free_bodies_[static_cast<std::size_t>(contactors_[c].index)].Shift();
  for (ContactConstraint& c : constraints_) {
    if (c.port_a >= 0) c.bias += c.J_a * port_shift_.segment<6>(c.port_a);
    if (c.port_b >= 0) c.bias += c.J_b * port_shift_.segment<6>(c.port_b);
  }
  for (LimitConstraint& limit : limits_) limit.bias += limit.sign * port_shift_(limit.row);
}

}  // namespace fork1s
