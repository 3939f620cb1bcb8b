// Motions of a mechanism that no spring resists, one by one, for people.
#pragma once

#include <fork1s/reduction/statics.hpp>
#include <string>
#include <vector>

namespace fork1s {

/// A motion of joints that keeps all loops closed and stretches no spring, with the base held.
struct FreeMotion {
  VectorX q;       ///< n joint displacements, the largest 1 rad or one length of the mechanism
  int pivot = -1;  ///< coordinate that moves in this motion alone, the farthest of these
  std::vector<JointIndex> joints;  ///< that move, largest share first
  std::vector<std::string>
      ties;        ///< tendons, springy closures, couplings and loops on these joints, which do not hold them
  BodyIndex body;  ///< of those asked for, the one that moves most; invalid where none moves
  Vector6 twist = Vector6::Zero();  ///< of that body in world axes about its origin [rad, m]

  /// One sentence: what moves, why nothing holds it, what would.
  std::string Text(const Mechanism& mechanism) const;
};

/// All of them at the pose q, each with as few joints as its neighbours allow. `bodies`: those whose motion
/// is of interest, all where empty. With `loads` (gravity and controls) less those that rest and that these
/// and the preload of springs resist by their geometric stiffness.
std::vector<FreeMotion> FindFreeMotions(const Mechanism& mechanism, const VectorX& q,
                                        const std::vector<BodyIndex>& bodies = {},
                                        const StaticsOptions* loads = nullptr);

/// Likewise the motions of no stiffness about an equilibrium q under load.
std::vector<FreeMotion> FindSingularMotions(const Mechanism& mechanism, const VectorX& q,
                                            const TangentStiffness& tangent,
                                            const std::vector<BodyIndex>& bodies = {});

}  // namespace fork1s
