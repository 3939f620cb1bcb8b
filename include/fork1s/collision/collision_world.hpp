// Contact points between shapes, by MuJoCo's collision detection.
#pragma once

#include <algorithm>
#include <fork1s/base/error.hpp>
#include <fork1s/mechanism/definition.hpp>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace fork1s {

/// A body as collision sees it: shapes that move together.
struct CollisionBodyDef {
  std::string name;
  std::vector<GeometryDef> geometries;  // those that do not collide are left out
  bool moves = true;                    // false: part of the still world, X_WB never changes
  RigidTransform X_WB;                  // initial pose, and the pose of still bodies for ever
};

/// One contact point, world frame.
struct ContactPoint {
  int body_a = -1;  // index of the collision body
  int body_b = -1;
  int geometry_a = -1;  // index in the body's geometries
  int geometry_b = -1;
  Vector3 point = Vector3::Zero();      // midway between the surfaces, m
  Matrix3 frame = Matrix3::Identity();  // rows: normal from a to b, tangent 1, tangent 2
  double gap = 0;                       // m, less the margins of the shapes; negative in penetration
  double friction = 0;  // of the higher priority, else the larger; 0 if all who decide are frictionless
  Vector2 friction_scale = Vector2::Ones();  // shares of it along the tangents
  double torsion = 0, rolling = 0;           // m, likewise; 0 where the pair bears no such moment
  double restitution = 0;                    // share of the speed of approach that is left
  double adhesion_gap = 0;  // m: gap up to which adhesion acts, the sum of the two or that of the pair
  double adhesion = 0;      // N: of the shapes, which pulls both together
  /// What the surface of b moves by within itself less that of a: about the normal [rad/s], along the tangents [m/s].
  Vector3 surface_velocity = Vector3::Zero();
};

struct CollisionOptions {
  double margin = 0.001;  // m: contacts are reported from this gap on
  bool multi_point =
      true;  // where flat convex shapes rest on each other: all corners of the overlap, else one point
};

/// Gaps [m] from which on two bodies are in contact: what both may move, at most `most`.
struct CollisionMargins {
  double most = 0;
  std::vector<double> reach;         // by body; empty: `most` for all
  std::vector<double> reach_within;  // the same towards bodies of the same group, which move along
  std::vector<int> group;            // by body; -1: of none

  double Of(int body_a, int body_b) const {
    if (reach.empty()) return most;
    const auto a = static_cast<std::size_t>(body_a), b = static_cast<std::size_t>(body_b);
    const std::vector<double>& moves = group[a] >= 0 && group[a] == group[b] ? reach_within : reach;
    return std::min(most, moves[a] + moves[b]);
  }
};

/// Bodies are numbered in the order given. Bodies that do not move never touch each other.
class CollisionWorld {
 public:
  /// `excluded`: pairs of body indices that never touch, but by `contact_pairs`, which GeometryDef::pairs
  /// refers to.
  static Expected<CollisionWorld> Create(const std::vector<CollisionBodyDef>& bodies,
                                         const std::vector<std::pair<int, int>>& excluded,
                                         const CollisionOptions& options = {},
                                         const std::vector<ContactPairDef>& contact_pairs = {});
  ~CollisionWorld();
  CollisionWorld(CollisionWorld&&) noexcept;
  CollisionWorld& operator=(CollisionWorld&&) noexcept;

  /// Pose of a moving body.
  void SetPose(int body, const RigidTransform& X_WB);
  /// Gap [m] from which on Detect reports contacts; a larger one costs narrow-phase tests of pairs that only
  /// pass by.
  void SetMargin(double margin);
  /// Finds the contacts at the present poses. Replaces the content of `contacts`; does not allocate once
  /// `contacts` has capacity. Returns false when the detector dropped contacts for want of room.
  bool Detect(std::vector<ContactPoint>& contacts);
  /// The same with a margin for every two bodies in place of that of SetMargin.
  bool Detect(const CollisionMargins& margins, std::vector<ContactPoint>& contacts);
  /// Pairs of bodies of which some shapes are tested against each other, the smaller index first, sorted.
  std::vector<std::pair<int, int>> PairsThatMayTouch() const;

 private:
  CollisionWorld();
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

}  // namespace fork1s
