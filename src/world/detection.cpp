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

// Largest way of a collision body within h at its present velocity [m].
double MotionWithin(const Bodies& bodies, const Detection& d, double h) {
  double motion = 0;
  for (std::size_t i = 0; i < d.collision_bodies.size(); ++i) {
    if (d.collision_bodies[i].kind == CollisionBody::Kind::kWorld) continue;
    const Vector6 V = bodies.VelocityOf(d.collision_bodies[i]);
    motion = std::max(motion, h * (V.tail<3>().norm() + V.head<3>().norm() * d.shapes.radius[i]));
  }
  return motion;
}

}  // namespace

double Detection::LargestPairMotion() const {
  double first = 0, second = 0;
  for (const double own : motion) {
    second = std::max(second, std::min(first, own));
    first = std::max(first, own);
  }
  return first + second;
}

// What can close within a step: twice the last step's motion, what gravity adds, and what was not foreseen.
bool Detection::Find(const Bodies& bodies, double h, const Vector3& gravity_W, bool in_stage) {
  motion.assign(collision_bodies.size(), 0.0);
  constexpr int kWorthAThread = 100;  // some 30 us
  ForAll(collision_bodies.size(), kWorthAThread, [&](std::size_t i) {
    if (collision_bodies[i].kind == CollisionBody::Kind::kWorld) return;
    const RigidTransform X = bodies.PoseOf(collision_bodies[i]);
    world->SetPose(static_cast<int>(i), X);
    if (in_stage) motion[i] = MotionBetween(stage_start_poses[i], X, shapes.radius[i]);
    poses[i] = X;
  });
  const double needed =
      kClearShare * shapes.least_size + 2 * MotionWithin(bodies, *this, h) + gravity_W.norm() * h * h;
  margin = std::max(least_margin, std::min(most_margin, needed));
  margin = std::max(margin, adhesion_reach);
  if (in_stage) margin = std::max(margin, LargestPairMotion());
  if (!std::isfinite(margin)) return false;
  world->SetMargin(margin);
  dropped = !world->Detect(points);
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
  stage_start_poses.resize(collision_bodies.size());
  for (std::size_t i = 0; i < collision_bodies.size(); ++i)
    if (collision_bodies[i].kind != CollisionBody::Kind::kWorld)
      stage_start_poses[i] = bodies.PoseOf(collision_bodies[i]);
}

bool Detection::CoversMotion(const Bodies& bodies) {
  motion.assign(collision_bodies.size(), 0.0);
  for (std::size_t i = 0; i < collision_bodies.size(); ++i)
    if (collision_bodies[i].kind != CollisionBody::Kind::kWorld)
      motion[i] = MotionBetween(poses[i], bodies.PoseOf(collision_bodies[i]), shapes.radius[i]);
  const double largest = LargestPairMotion();
  if (largest <= margin) return true;
  least_margin = std::max(least_margin, 2 * largest);
  return false;
}

}  // namespace fork1s
