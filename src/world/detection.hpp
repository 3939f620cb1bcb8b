// Contact points within reach, and how far they were sought.
#pragma once

#include <fork1s/collision/collision_world.hpp>
#include <memory>
#include <vector>

#include "bodies.hpp"
#include "collision_body_shapes.hpp"

namespace fork1s {

/// What contacts may move a body by that was not foreseen, as a share of the size of what touches.
inline constexpr double kClearShare = 0.02;

struct Detection {
  /// Contact points at the poses at hand that may close within h [s] of the velocities at hand; none and
  /// false where something moves beyond the range of numbers. `in_stage`: that what moved since the start of
  /// the stage is covered too.
  bool Find(const Bodies& bodies, double h, const Vector3& gravity_W, bool in_stage);
  void RecordStageStart(const Bodies& bodies);
  /// Whether contacts were sought as far as the poses at hand are from those of the detection; else the least
  /// margin of the next one is as wide.
  bool CoversMotion(const Bodies& bodies);
  /// Which of that many free bodies `points` are of.
  void FindTouched(std::size_t free_bodies);
  /// Sum of the two largest of `motion` [m]: no pair closes its gap by more.
  double LargestPairMotion() const;

  std::vector<CollisionBody> collision_bodies;
  CollisionBodyShapes shapes;
  std::unique_ptr<CollisionWorld> world;
  double most_margin = 0;                         // m
  double margin = 0;                              // m, of the last detection
  double least_margin = 0;                        // m, of the next one
  double adhesion_reach = 0;                      // m: largest gap that an adhesion acts over
  std::vector<ContactPoint> points;               // of the last detection
  bool dropped = false;                           // for want of room
  std::vector<char> touched;                      // per free body, by FindTouched
  std::vector<RigidTransform> poses;              // per collision body, at the last detection
  std::vector<RigidTransform> stage_start_poses;  // per collision body
  std::vector<double>
      motion;  // m, per collision body: to the poses of CoversMotion, or since the start of the stage
};

}  // namespace fork1s
