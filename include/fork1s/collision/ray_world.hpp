// Where a ray first meets a shape.
#pragma once

#include <fork1s/collision/collision_world.hpp>
#include <limits>
#include <optional>
#include <span>

namespace fork1s {

/// Where a ray comes in, world frame.
struct RayHit {
  int body = -1;        // index of the collision body
  int geometry = -1;    // index in the body's geometries
  double distance = 0;  // m, from the origin
  Vector3 point = Vector3::Zero();
  Vector3 normal = Vector3::Zero();  // of the surface, unit, towards where the ray came from
};

/// Bodies as rays see them: by the shapes that collide, or by all of a body that has none of these. Meshes
/// are their convex hulls, as for contact.
class RayWorld {
 public:
  /// Bodies are numbered in the order given. Errors: kModel, as of CollisionWorld.
  static Expected<RayWorld> Create(std::vector<CollisionBodyDef> bodies);
  ~RayWorld();
  RayWorld(RayWorld&&) noexcept;
  RayWorld& operator=(RayWorld&&) noexcept;

  /// Pose of a moving body.
  void SetPose(int body, const RigidTransform& X_WB);
  /// The first shape along `direction` (of any length above 0) from `origin` that is no farther than `reach`
  /// [m]. An origin within a shape may see that shape from inside or not at all.
  std::optional<RayHit> Cast(const Vector3& origin, const Vector3& direction,
                             double reach = std::numeric_limits<double>::infinity()) {
    return Cast(origin, direction, reach, -1, {});
  }
  /// The same through these geometries of a body as if they were not there.
  std::optional<RayHit> Cast(const Vector3& origin, const Vector3& direction, double reach, int body,
                             std::span<const int> unseen);

 private:
  RayWorld();
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

}  // namespace fork1s
