#include "mechanism/rigid_groups.hpp"

#include <algorithm>

namespace fork1s::internal {

std::vector<std::size_t> RigidGroups(const MechanismDef& mechanism) {
  std::vector<bool> has_joint(mechanism.bodies.size(), false);
  for (const JointDef& joint : mechanism.joints) has_joint[joint.body.u()] = true;
  std::vector<std::size_t> group(mechanism.bodies.size());
  for (std::size_t b = 0; b < group.size(); ++b) {
    const BodyIndex parent = mechanism.bodies[b].parent;
    group[b] = has_joint[b] || !parent.valid() ? b : group[parent.u()];
  }
  return group;
}

bool HasColliders(const BodyDef& body) {
  return std::any_of(body.geometries.begin(), body.geometries.end(),
                     [](const GeometryDef& g) { return g.Collides(); });
}

std::vector<BodyIndex> BodiesWithoutContact(const MechanismDef& mechanism,
                                            const std::vector<BodyIndex>& interfaces) {
  const std::vector<std::size_t> group = RigidGroups(mechanism);
  std::vector<bool> touches(group.size(), false);
  touches[0] = true;
  for (const BodyIndex b : interfaces) touches[group[b.u()]] = true;
  std::vector<BodyIndex> out;
  for (std::size_t b = 0; b < group.size(); ++b)
    if (!touches[group[b]] && HasColliders(mechanism.bodies[b])) out.emplace_back(b);
  return out;
}

}  // namespace fork1s::internal
