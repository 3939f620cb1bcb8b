// MuJoCo 2.2.2 reports some distances that are not the gap between the surfaces; this puts them right.
#pragma once

#include <mujoco/mujoco.h>

namespace fork1s::internal {

/// Gap between the surfaces at a contact, negative in penetration, m.
///  - box on box, faces: `dist` is half the gap, while the point is midway between the surfaces. Where the
///    normal is that of a face the gap is therefore twice the height of the point over that face. Edge on
///    edge is right as it is.
///  - height fields under anything but spheres (sphere_on_grid.hpp): the margin enters twice, raising each
///  prism by it and growing the other shape by half.
double TrueGap(const mjModel* model, const mjData* data, const mjContact& contact);

}  // namespace fork1s::internal
