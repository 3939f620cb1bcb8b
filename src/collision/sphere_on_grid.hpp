// Spheres on height fields, exactly: feet on terrain.
//
// MuJoCo takes each column of the field for a convex body of its own. It finds the nearest point as exactly,
// but beside it one for every column within the margin, 28 where the ground has 1.5, and pushes what lies
// deeper than a cell is wide out through the sides of its column. docs/contact_detection.md has the figures.
#pragma once

#include <mujoco/mujoco.h>

#include <array>
#include <fork1s/base/types.hpp>
#include <utility>

namespace fork1s::internal {

/// Contacts of a sphere with the upper surface of a height field, in MuJoCo's form: one at every point of the
/// surface that is nearest to the centre among its neighbours and nearer than radius + margin; where the
/// centre is under the surface, one at the face through which it leaves soonest and one at each that makes a
/// valley with it. Returns how many. Only the 16 nearest faces are looked at: under a ball much larger than
/// the cells, a second place farther off can be missed. The sides and the bottom of the field do not count.
int SphereOnGrid(const mjModel* model, mjData* data, mjPreContact* contacts, int grid, int sphere,
                 mjtNum margin);

/// The same of any ball, also of a point; the nearest first. Room for 16.
int BallOnGrid(const mjModel* model, const mjData* data, mjPreContact* contacts, int grid,
               const Vector3& center, double radius, double margin);

/// Whether a plane through a point of the surface, with this normal (both in the world), has the surface
/// around the point under it. If not, no shape on the other side of the plane touches the field there: the
/// point lies on the side of a column, or a neighbour stands higher.
bool SupportsFromBelow(const mjModel* model, const mjData* data, int grid, const Vector3& point,
                       const Vector3& normal);

/// Edges of the surface that a point of it lies on, none twice.
struct EdgesOfGrid {
  static constexpr int kMost = 6;                       // that meet in a corner of the grid
  std::array<std::pair<Vector3, Vector3>, kMost> ends;  // world
  int count = 0;
};
EdgesOfGrid EdgesThrough(const mjModel* model, const mjData* data, int grid, const Vector3& point);

}  // namespace fork1s::internal
