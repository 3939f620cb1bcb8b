// The shapes of a contact group, in the frame of the body that names it.
#pragma once

#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <utility>
#include <vector>

namespace fork1s {

inline std::vector<GeometryDef> GroupGeometry(const Mechanism& mechanism, const ContactGroup& group) {
  std::vector<GeometryDef> geometries;
  const RigidTransform X_GR = mechanism.body(group.body).X_RB0.inverse();
  for (BodyIndex b : group.bodies)
    for (GeometryDef g : mechanism.definition().bodies[b.u()].geometries) {
      if (!g.Collides()) continue;
      g.X_BG = X_GR * mechanism.body(b).X_RB0 * g.X_BG;
      geometries.push_back(std::move(g));
    }
  return geometries;
}

}  // namespace fork1s
