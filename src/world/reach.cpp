// What may be met within a stage: how far contacts and stops are sought, and from which pose.
//
// A stage finds contacts at the pose that its predicted velocity leads to, within a margin. The velocity
// found may lead farther than that, by servos, pushes and impacts of the stage itself, and what is met beyond
// the margin would be passed. So the motion from the pose of detection to the pose found is compared with the
// margin; where it is longer, the iteration is repeated with contacts within that motion.
//
// Contacts of such an iteration are those of the pose where the stage starts, as speculative contacts are (E.
// Catto, GDC 2013): at a pose beyond the middle of a thin body the normal points to the far side. An
// iteration from there is never the last: the next one linearizes at the pose found.
#include <algorithm>
#include <cmath>
#include <limits>

#include "detail.hpp"

namespace fork1s {
namespace {

// Radius [m] of a sphere that the shape contains; of a mesh half of its least extent along the axes of its
// file.
struct InnerRadiusOf {
  double operator()(const Plane&) const { return std::numeric_limits<double>::infinity(); }
  double operator()(const Sphere& s) const { return s.radius; }
  double operator()(const Capsule& s) const { return s.radius; }
  double operator()(const Cylinder& s) const { return std::min(s.radius, s.half_length); }
  double operator()(const Ellipsoid& s) const { return s.radii.minCoeff(); }
  double operator()(const Box& s) const { return s.half.minCoeff(); }
  double operator()(const MeshShape& s) const {
    if (!s.mesh || s.mesh->vertices.empty()) return 0;
    Eigen::Vector3f least = s.mesh->vertices.front(), most = least;
    for (const auto& v : s.mesh->vertices) {
      least = least.cwiseMin(v);
      most = most.cwiseMax(v);
    }
    return 0.5 * static_cast<double>((most - least).minCoeff());
  }
  double operator()(const HeightField&) const { return std::numeric_limits<double>::infinity(); }
};

}  // namespace

// |R - R₀| (Frobenius) is √8 sin(angle/2), the chord of a point at the radius r is 2 r sin(angle/2).
double World::Detail::MotionBetween(const RigidTransform& from, const RigidTransform& to, double radius) {
  return (to.translation() - from.translation()).norm() +
         (to.rotation() - from.rotation()).norm() / std::sqrt(2.0) * radius;
}

double World::Detail::InnerRadius(const Shape& shape) { return std::visit(InnerRadiusOf{}, shape); }

// Sum of the two largest motions of contactors [m]: no pair closes its gap by more.
double World::Detail::LargestPairMotion() const {
  double first = 0, second = 0;
  for (const double own : contactor_motion_) {
    second = std::max(second, std::min(first, own));
    first = std::max(first, own);
  }
  return first + second;
}

RigidTransform World::Detail::PoseOf(const Contactor& c) const {
  const auto index = static_cast<std::size_t>(c.index);
  return c.kind == Contactor::Kind::kGroup ? GroupPose(mechanisms_[index], c.group)
                                           : free_bodies_[index].pose();
}

// Whether the predicted motion to the pose of detection, which the margin covers, may have led past something:
// by more than half of the sum of two inner radii. Beyond that sum the least way out of a pair is on the far
// side; half of it leaves room for edges.
bool World::Detail::MayHavePassed() {
  bool may = false;
  for (std::size_t i = 0; i < points_.size() && !may; ++i) {
    const ContactPoint& p = points_[i];
    const auto a = static_cast<std::size_t>(p.body_a), b = static_cast<std::size_t>(p.body_b);
    const double motion = contactor_motion_[a] + contactor_motion_[b];
    may = points_[i].gap < motion && !Bore(i) &&
          motion > 0.5 * (inner_radius_[a][static_cast<std::size_t>(p.geometry_a)] +
                          inner_radius_[b][static_cast<std::size_t>(p.geometry_b)]);
  }
  if (may) least_margin_ = std::max(least_margin_, 2 * LargestPairMotion());
  return may;
}

void World::Detail::RecordStageStart(bool of_step) {
  for (MechanismDynamics& m : mechanisms_) fork1s::RecordStageStart(m, of_step);
  for (FreeBody& body : free_bodies_) body.RecordStageStart(of_step);
  stage_start_pose_.resize(contactors_.size());
  for (std::size_t i = 0; i < contactors_.size(); ++i)
    if (contactors_[i].kind != Contactor::Kind::kWorld) stage_start_pose_[i] = PoseOf(contactors_[i]);
}

// Contacts at the pose where the stage, of length b, starts.
bool World::Detail::PrepareContactsAtStageStart(const StepOptions& stage, StepReport& report) {
  {
    const PartClock clock(times_, &StepPartTimes::moving);
    ForMechanisms([&](std::size_t i) { MoveToStageStart(mechanisms_[i], stage.h); });
    for (FreeBody& body : free_bodies_) body.MoveToStageStart(stage.h);
  }
  from_stage_start_ = true;
  if (!PrepareContacts(stage, report)) return false;
  ForMechanisms([&](std::size_t i) {
    RestoreStageBaseTwist(mechanisms_[i]);
    EvaluateStage(mechanisms_[i], stage.h);
  });
  return true;
}

// Whether contacts and stops were sought as far as the pose found is from that of detection. Else the next
// iteration seeks them there.
bool World::Detail::CoversMotion() {
  contactor_motion_.assign(contactors_.size(), 0.0);
  for (std::size_t i = 0; i < contactors_.size(); ++i) {
    const Contactor& c = contactors_[i];
    if (c.kind == Contactor::Kind::kWorld) continue;
    const RigidTransform X = PoseOf(c);
    contactor_motion_[i] = MotionBetween(contactor_pose_[i], X, contactor_radius_[i]);
  }
  const double motion = LargestPairMotion();
  const bool covers = motion <= search_margin_;
  if (!covers) least_margin_ = std::max(least_margin_, 2 * motion);
  const bool stops = all_stops_ || !PassesStop();
  all_stops_ = all_stops_ || !stops;
  return covers && stops;
}

// Whether the base point of the second stage lies beyond a contact or stop that carried no load at the start
// of the step. From there a stage may go on without a force: what overlaps is pushed apart at a bounded speed
// only.
bool World::Detail::BasePointIsBeyond(const StepOptions& options, StepSubject& subject) const {
  for (const StopApproach& a : stop_approach_) {
    if (a.bore || !(a.base_gap < -options.h * impact_speed_)) continue;
    subject = {StepSubject::Kind::kStop, a.mechanism, a.stop};
    return true;
  }
  for (std::size_t i = 0; from_stage_start_ && i < points_.size(); ++i) {
    if (Bore(i) || !(points_[i].gap < -options.h * SpeedOfImpact(points_[i]))) continue;
    subject = {StepSubject::Kind::kContact, points_[i].body_a, points_[i].body_b};
    return true;
  }
  return false;
}

// Whether a stop without a row is violated at the pose found.
bool World::Detail::PassesStop() const {
  for (std::size_t i = 0; i < mechanisms_.size(); ++i) {
    const MechanismDynamics& m = mechanisms_[i];
    if (m.step_model().parts.empty()) continue;
    const std::vector<char>& is_row = mechanism_blocks_[i].stop_is_row;
    for (std::size_t k = 0; k < m.length_limits().size(); ++k) {
      if (is_row[2 * k] && is_row[2 * k + 1]) continue;
      const Mechanism::LengthLimit& limit = m.length_limits()[k];
      const double length = m.Length(limit.length);
      if ((!is_row[2 * k] && length < limit.lower) || (!is_row[2 * k + 1] && length > limit.upper))
        return true;
    }
  }
  return false;
}

}  // namespace fork1s
