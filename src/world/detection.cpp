#include "detection.hpp"

#include <algorithm>
#include <cmath>

namespace fork1s {
namespace {

// Largest displacement [m] of a point within `radius` of the frame. |R - R₀| (Frobenius) is √8 sin(angle/2),
// the chord of a point at the radius r is 2 r sin(angle/2).
double MotionBetween(const RigidTransform& from, const RigidTransform& to, double radius) {
  return (to.translation() - from.translation()).norm() +
         (to.rotation() - from.rotation()).norm() / std::sqrt(2.0) * radius;
}

// Sum of the two largest.
double LargestPair(const std::vector<double>& of_bodies) {
  double first = 0, second = 0;
  for (const double own : of_bodies) {
    second = std::max(second, std::min(first, own));
    first = std::max(first, own);
  }
  return first + second;
}

void FindBases(const Bodies& bodies, std::vector<RigidTransform>& bases) {
  bases.resize(bodies.mechanisms.size());
  for (std::size_t m = 0; m < bases.size(); ++m) bases[m] = bodies.mechanisms[m].state().X_WR;
}

// Twist of a body, world axes about the origin of X, relative to the base of its mechanism.
Vector6 TwistWithin(const ReducedState& base, const RigidTransform& X, const Vector6& V_W) {
  const Matrix3& R_W = base.X_WR.rotation();
  const Vector3 omega_W = R_W * base.V_R.head<3>(), arm_W = X.translation() - base.X_WR.translation();
  Vector6 relative = V_W;
  relative.head<3>() -= omega_W;
  relative.tail<3>() -= R_W * base.V_R.tail<3>() + omega_W.cross(arm_W);
  return relative;
}

}  // namespace

void Detection::FindBaseMotions(const Bodies& bodies, const std::vector<RigidTransform>& from) {
  base_motions_.resize(bodies.mechanisms.size());
  for (std::size_t m = 0; m < base_motions_.size(); ++m) {
    const RigidTransform& to = bodies.mechanisms[m].state().X_WR;
    base_motions_[m].moves =
        !(to.translation() == from[m].translation() && to.rotation() == from[m].rotation());
    if (base_motions_[m].moves) base_motions_[m].X = to * from[m].inverse();
  }
}

// Of a collision body from one pose to another, and beyond what its base moved.
void Detection::Measure(std::size_t i, const RigidTransform& from, const RigidTransform& to) {
  const double radius = shapes.radius[i];
  motion.in_world[i] = motion.within[i] = MotionBetween(from, to, radius);
  if (collision_bodies[i].kind != CollisionBody::Kind::kGroup) return;
  const BaseMotion& base = base_motions_[static_cast<std::size_t>(collision_bodies[i].index)];
  if (base.moves) motion.within[i] = MotionBetween(base.X * from, to, radius);
}

// What can close within a step: twice the last step's motion, what gravity adds, and what was not foreseen.
bool Detection::Find(const Bodies& bodies, double h, const Vector3& gravity_W, bool in_stage) {
  constexpr int kWorthAThread = 100;  // some 30 us
  const std::size_t count = collision_bodies.size();
  motion.Reset(count);
  margins.reach.assign(count, 0.0);
  margins.reach_within.assign(count, 0.0);
  FindBases(bodies, bases);
  if (in_stage) FindBaseMotions(bodies, stage_start_bases);
  ForAll(count, kWorthAThread, [&](std::size_t i) {
    const CollisionBody& body = collision_bodies[i];
    if (body.kind == CollisionBody::Kind::kWorld) return;
    const RigidTransform X = bodies.PoseOf(body);
    world->SetPose(static_cast<int>(i), X);
    if (in_stage) Measure(i, stage_start_poses[i], X);
    poses[i] = X;
    const auto way = [&](const Vector6& V) {
      return 2 * h * (V.tail<3>().norm() + V.head<3>().norm() * shapes.radius[i]);
    };
    const Vector6 V = bodies.VelocityOf(body);
    margins.reach[i] = margins.reach_within[i] = way(V);
    const MechanismDynamics* of = bodies.MechanismOf(body);
    if (of == nullptr) return;
    if (!of->state().V_R.isZero(0)) margins.reach_within[i] = way(TwistWithin(of->state(), X, V));
  });
  const double unforeseen = kClearShare * shapes.least_size + gravity_W.norm() * h * h;
  const auto widen = [&](const std::vector<double>& least, const std::vector<double>& moved,
                         std::vector<double>& reach) {
    for (std::size_t i = 0; i < count; ++i) {
      if (collision_bodies[i].kind != CollisionBody::Kind::kWorld)
        reach[i] = std::max({reach[i], moved[i], least[i]});
      reach[i] = std::max(reach[i] + 0.5 * unforeseen, 0.5 * adhesion_reach);
    }
  };
  const double fastest = *std::max_element(margins.reach.begin(), margins.reach.end());
  widen(least_reach.in_world, motion.in_world, margins.reach);
  widen(least_reach.within, motion.within, margins.reach_within);
  margins.most = std::max({adhesion_reach, LargestPair(least_reach.in_world), LargestPair(motion.in_world),
                           std::min(most_margin, unforeseen + fastest)});
  if (!std::isfinite(margins.most)) return false;
  dropped = !world->Detect(margins, points);
  return true;
}

void Detection::FindTouched(std::size_t free_bodies) {
  touched.assign(free_bodies, 0);
  for (const ContactPoint& p : points)
    for (const int body : {p.body_a, p.body_b})
      if (const CollisionBody& c = collision_bodies[static_cast<std::size_t>(body)];
          c.kind == CollisionBody::Kind::kFreeBody)
        touched[static_cast<std::size_t>(c.index)] = 1;
}

void Detection::RecordStageStart(const Bodies& bodies) {
  FindBases(bodies, stage_start_bases);
  stage_start_poses.resize(collision_bodies.size());
  for (std::size_t i = 0; i < collision_bodies.size(); ++i)
    if (collision_bodies[i].kind != CollisionBody::Kind::kWorld)
      stage_start_poses[i] = bodies.PoseOf(collision_bodies[i]);
}

bool Detection::CoversMotion(const Bodies& bodies) {
  motion.Reset(collision_bodies.size());
  FindBaseMotions(bodies, bases);
  bool covers = true;
  for (std::size_t i = 0; i < collision_bodies.size(); ++i) {
    if (collision_bodies[i].kind == CollisionBody::Kind::kWorld) continue;
    Measure(i, poses[i], bodies.PoseOf(collision_bodies[i]));
    covers = covers && motion.in_world[i] <= margins.reach[i] && motion.within[i] <= margins.reach_within[i];
  }
  covers = covers && LargestPair(motion.in_world) <= margins.most;
  if (!covers) WidenToMotion();
  return covers;
}

void Detection::WidenToMotion() {
  for (std::size_t i = 0; i < collision_bodies.size(); ++i) {
    least_reach.in_world[i] = std::max(least_reach.in_world[i], 2 * motion.in_world[i]);
    least_reach.within[i] = std::max(least_reach.within[i], 2 * motion.within[i]);
  }
}

Vector3 Detection::MotionInStage(int body, const Vector3& p_W) const {
  const auto i = static_cast<std::size_t>(body);
  if (collision_bodies[i].kind == CollisionBody::Kind::kWorld) return Vector3::Zero();
  return p_W - stage_start_poses[i] * (poses[i].inverse() * p_W);
}

bool Detection::IsWidthFinite() const { return std::isfinite(LargestPair(least_reach.in_world)); }

}  // namespace fork1s
