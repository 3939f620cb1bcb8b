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
  /// Whether contacts were sought as far as the poses at hand are from those of the detection; else the next one seeks
  /// them as far.
  bool CoversMotion(const Bodies& bodies);
  /// The next one seeks contacts twice as far as everything moved.
  void WidenToMotion();
  void ForgetMotion() { least_reach.Reset(collision_bodies.size()); }
  bool IsWidthFinite() const;
  /// Which of that many free bodies `points` are of.
  void FindTouched(std::size_t free_bodies);
  /// By which two bodies may have closed their gap [m].
  double PairMotion(int a, int b) const { return motion.Of(a, b, margins.group); }
  /// From the start of the stage to the last detection, of the point of a body that is at `p_W` then [m].
  Vector3 MotionInStage(int body, const Vector3& p_W) const;

  std::vector<CollisionBody> collision_bodies;
  CollisionBodyShapes shapes;
  std::unique_ptr<CollisionWorld> world;
  double most_margin = 0;                                // m, of what is foreseen
  CollisionMargins margins;                              // of the last detection
  bool shapes_adhere = false;                            // some have adhesion of their own
  double adhesion_reach = 0;                             // m: largest gap that an adhesion acts over
  std::vector<ContactPoint> points;                      // of the last detection
  bool dropped = false;                                  // for want of room
  std::vector<char> touched;                             // per free body, by FindTouched
  std::vector<RigidTransform> poses;                     // per collision body, at the last detection
  std::vector<RigidTransform> stage_start_poses;         // per collision body
  std::vector<RigidTransform> bases, stage_start_bases;  // per mechanism, likewise
  /// m, per collision body: in the world, and relative to the base of its mechanism.
  struct Motion {
    std::vector<double> in_world, within;

    void Reset(std::size_t count) {
      in_world.assign(count, 0.0);
      within.assign(count, 0.0);
    }
    double Of(int body_a, int body_b, const std::vector<int>& group) const {
      const auto a = static_cast<std::size_t>(body_a), b = static_cast<std::size_t>(body_b);
      const std::vector<double>& moved = group[a] >= 0 && group[a] == group[b] ? within : in_world;
      return moved[a] + moved[b];
    }
  };
  Motion motion;       // to the poses of CoversMotion, or since the start of the stage
  Motion least_reach;  // of the next detection

 private:
  struct BaseMotion {  // in the world
    RigidTransform X;
    bool moves = false;
  };
  void FindBaseMotions(const Bodies& bodies, const std::vector<RigidTransform>& from);
  void Measure(std::size_t i, const RigidTransform& from, const RigidTransform& to);

  std::vector<BaseMotion> base_motions_;  // per mechanism
};

}  // namespace fork1s
