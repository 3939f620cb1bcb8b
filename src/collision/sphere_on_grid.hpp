// Spheres on height fields, exactly: feet on terrain.
//
// MuJoCo takes each prism of the field for a convex body of its own and asks its general routine, which
// iterates, to a tolerance, and meets the edges between prisms of a smooth slope as if they stuck out.
#pragma once

#include <mujoco/mujoco.h>

namespace fork1s::internal {

/// Name of the models that this applies to; those of others stay with MuJoCo's own routine.
inline constexpr const char* kCollisionModelName = "fork1s_collision";

/// Puts the routine below into MuJoCo's table, once.
void InstallSphereOnGrid();

/// Contacts of a sphere with the upper surface of a height field, in MuJoCo's form: one at every point of the
/// surface that is nearest to the centre among its neighbours and nearer than radius + margin; where the
/// centre is under the surface, one at the face through which it leaves soonest. Returns how many. Only the
/// 16 nearest faces are looked at: under a ball much larger than the cells, a second place farther off can be
/// missed. The sides and the bottom of the field do not count.
int SphereOnGrid(const mjModel* model, mjData* data, mjPreContact* contacts, int grid, int sphere,
                 mjtNum margin);

}  // namespace fork1s::internal
