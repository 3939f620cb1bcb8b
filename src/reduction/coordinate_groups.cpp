#include "coordinate_groups.hpp"

#include <fork1s/mechanism/kinematics.hpp>
#include <numeric>

namespace fork1s::internal {
namespace {

std::vector<std::vector<int>> GroupsOf(const Mechanism& mechanism, bool by_joints) {
  const auto n = static_cast<std::size_t>(mechanism.num_coordinates());
  std::vector<std::size_t> above(n);  // towards the first coordinate of the group
  std::iota(above.begin(), above.end(), std::size_t{0});
  const auto first = [&](std::size_t i) {
    while (above[i] != i) i = above[i] = above[above[i]];
    return i;
  };
  const auto join = [&](int a, int b) {
    const std::size_t x = first(static_cast<std::size_t>(a)), y = first(static_cast<std::size_t>(b));
    above[std::max(x, y)] = std::min(x, y);
  };
  const auto join_all = [&](const std::vector<int>& coordinates) {
    for (const int i : coordinates) join(coordinates.front(), i);
  };
  for (const Mechanism::Joint& joint : mechanism.joints()) {
    if (!by_joints) break;
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) join(joint.offset, i);
    if (joint.previous >= 0 && joint.size > 0)
      join(mechanism.joint(JointIndex(joint.previous)).offset, joint.offset);
  }
  for (const ClosureDef& closure : mechanism.closures()) join_all(ClosureCoordinates(mechanism, closure));
  for (const Mechanism::Coupling& k : mechanism.couplings()) join_all(k.Coordinates());
  for (const Mechanism::Spring& s : mechanism.springs()) join_all(mechanism.CoordinatesOf(s.length));

  std::vector<std::vector<int>> groups;
  std::vector<std::size_t> at(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (first(i) == i) {
      at[i] = groups.size();
      groups.emplace_back();
    }
    groups[at[first(i)]].push_back(static_cast<int>(i));
  }
  return groups;
}

}  // namespace

std::vector<std::vector<int>> CoordinateGroups(const Mechanism& mechanism) {
  return GroupsOf(mechanism, true);
}
std::vector<std::vector<int>> StaticGroups(const Mechanism& mechanism) { return GroupsOf(mechanism, false); }

std::vector<char> FindPoseDependent(const Mechanism& m) {
  std::vector<char> depends(static_cast<std::size_t>(m.num_coordinates()), 0);
  const auto add = [&](const std::vector<int>& coordinates) {
    for (const int i : coordinates) depends[static_cast<std::size_t>(i)] = 1;
  };
  for (const ClosureDef& c : m.closures()) add(ClosureCoordinates(m, c));
  for (const Mechanism::Coupling& c : m.couplings()) add(c.Coordinates());
  for (const Mechanism::Path& p : m.paths()) add(p.coordinates);
  for (const Mechanism::Spring& s : m.springs())
    if (!s.is_linear()) add(m.CoordinatesOf(s.length));
  return depends;
}

}  // namespace fork1s::internal
