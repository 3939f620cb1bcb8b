// What moves in a world.
#pragma once

#include <algorithm>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <fork1s/world/world.hpp>
#include <vector>

#include "for_all.hpp"
#include "stepping/mechanism_model.hpp"
#include "stepping/step_context.hpp"

namespace fork1s {

struct Bodies {
  std::vector<MechanismDynamics> mechanisms;
  std::vector<FreeBody> free_bodies;
  int mechanism_grain = 1;  // mechanisms that are worth a thread

  /// Of some 200 joint coordinates, 30 us.
  void SetMechanismGrain() {
    int coordinates = 0;
    for (const MechanismDynamics& m : mechanisms) coordinates += 1 + m.mechanism().num_coordinates();
    mechanism_grain =
        coordinates == 0 ? 1 : std::max(1, 200 * static_cast<int>(mechanisms.size()) / coordinates);
  }

  template <class Act>
  void ForMechanisms(const Act& act) const {
    ForAll(mechanisms.size(), mechanism_grain, act);
  }

  /// That a collision body is of; null: of none.
  const MechanismDynamics* MechanismOf(const CollisionBody& body) const {
    return body.kind == CollisionBody::Kind::kGroup ? &mechanisms[static_cast<std::size_t>(body.index)]
                                                    : nullptr;
  }
  RigidTransform PoseOf(const CollisionBody& collision_body) const {  // but of the world's
    const auto i = static_cast<std::size_t>(collision_body.index);
    return collision_body.kind == CollisionBody::Kind::kGroup ? GroupPose(mechanisms[i], collision_body.group)
                                                              : free_bodies[i].pose();
  }
  /// Twist in world axes about the origin of the collision body's frame.
  Vector6 VelocityOf(const CollisionBody& collision_body) const {
    const auto i = static_cast<std::size_t>(collision_body.index);
    return collision_body.kind == CollisionBody::Kind::kGroup
               ? GroupVelocity(mechanisms[i], collision_body.group)
               : free_bodies[i].OriginVelocity();
  }
};

}  // namespace fork1s
