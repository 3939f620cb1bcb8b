// What a step of a world reads and changes, as plain values.
#pragma once

#include <array>
#include <cstdint>
#include <fork1s/collision/collision_world.hpp>
#include <fork1s/stepping/free_body.hpp>
#include <fork1s/stepping/mechanism_state.hpp>
#include <vector>

namespace fork1s {

/// A contact as it was solved.
struct ContactRecord {
  ContactPoint point;
  Vector3 impulse = Vector3::Zero();  // normal, tangents [N·s], in the frame of the point, on body b
  // Sums over the stages of the step, each in the contact frame of its own pose [N·s]. `impulse`, their
  // vector sum, leaves the friction cone where that frame turns between them.
  double normal_sum = 0, tangential_sum = 0;
  // Of adhesion, on body b, in the frame of the point [N·s]; `impulse` bears the compression by it, and both
  // together move the bodies.
  Vector3 pull = Vector3::Zero();
  double friction = 0;               // coefficient in the direction of the tangential impulse, as solved
  Vector3 moment = Vector3::Zero();  // about normal and tangents [N·m·s], likewise
  double utilization = 0;            // of the cone, above 1 where it slides
  bool gives_way = false;            // as ContactConstraint::gives_way, in the last stage
  // At the end of the step, from which the tangential springs of the next one start; `impulse` is the whole step's.
  Vector3 end_force = Vector3::Zero();   // N
  Vector3 end_moment = Vector3::Zero();  // N·m
  double end_speed = 0;                  // m/s, along the normal by its rows; below 0 while a gap closes
};

/// What moves body b, in world axes [N·s]: contact and adhesion.
inline Vector3 NetImpulse(const ContactRecord& c) { return c.point.frame.transpose() * (c.impulse + c.pull); }

/// What a SwitchedClosureDef did in the last step.
struct SwitchedClosureRecord {
  bool acts = false;
  Vector3 point_W = Vector3::Zero();    // m: the origin of frame J on body b where the step ends
  Vector3 impulse_W = Vector3::Zero();  // N·s, on body b
  Vector3 moment_W = Vector3::Zero();   // N·m·s, on body b about that point
};

/// All that the next step of a world depends on beside what it was made of. For worlds made of the same scene
/// with the same options.
struct WorldState {
  std::vector<MechanismState> mechanisms;
  std::vector<FreeBody::State> free_bodies;

  // Contact of the last step, from which the next one starts.
  std::vector<ContactRecord> contacts;
  double contacts_h = 0;  // s, of the step that gave them their impulses
  std::vector<RigidTransform> collision_body_poses;
  std::array<double, 2> contraction = {1,
                                       1};  // of Newton's iteration in first and second stages; 1: not known
  struct Rows {                             // per mechanism
    std::vector<double> limit_impulses, friction_impulses;
    bool refreshed = false;  // at the end of the last step
  };
  std::vector<Rows> rows;
  std::vector<SwitchedClosureRecord> switched_closures;  // for reports: no step starts from them
};

/// 64 bits over those of every field, sizes included; of a reduced model over the pose that it is about.
/// `inputs`: what else the next step is given.
std::uint64_t HashOf(const WorldState& state, const VectorX& inputs = VectorX());

}  // namespace fork1s
