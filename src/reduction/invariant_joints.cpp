#include "reduction/invariant_joints.hpp"

#include <algorithm>

#include "coordinate_groups.hpp"

namespace fork1s {
namespace {

bool IsLastOfInterface(const Mechanism& m, int j, const std::vector<BodyIndex>& interfaces) {
  return std::none_of(m.joints().begin(), m.joints().end(),
                      [&](const Mechanism::Joint& other) { return other.previous == j; }) &&
         std::any_of(interfaces.begin(), interfaces.end(),
                     [&](BodyIndex b) { return m.body(b).last_joint == j; });
}

// Joint `k` or one that it carries.
bool Carries(const Mechanism& m, int k, int j) {
  while (j >= 0 && j != k) j = m.joint(JointIndex(j)).previous;
  return j >= 0;
}

std::vector<int> JointsOfCoordinates(const Mechanism& m) {
  std::vector<int> joints(static_cast<std::size_t>(m.num_coordinates()));
  for (int j = 0; j < m.num_joints(); ++j) {
    const Mechanism::Joint& joint = m.joint(JointIndex(j));
    std::fill_n(joints.begin() + joint.offset, joint.size, j);
  }
  return joints;
}

}  // namespace

std::vector<char> FindInvariantJoints(const Mechanism& m, const std::vector<BodyIndex>& interfaces) {
  std::vector<char> is_invariant(static_cast<std::size_t>(m.num_coordinates()), 0);
  const std::vector<char> depends_on_pose = internal::FindPoseDependent(m);
  const std::vector<int> joint_of = JointsOfCoordinates(m);
  for (const std::vector<int>& group : internal::CoordinateGroups(m))
    for (const int i : group) {
      const int j = joint_of[static_cast<std::size_t>(i)];
      const auto carries = [&](int other) {
        return Carries(m, j, joint_of[static_cast<std::size_t>(other)]);
      };
      is_invariant[static_cast<std::size_t>(i)] =
          !depends_on_pose[static_cast<std::size_t>(i)] && m.joint(JointIndex(j)).size == 1 &&
          (IsLastOfInterface(m, j, interfaces) || std::all_of(group.begin(), group.end(), carries));
    }
  return is_invariant;
}

}  // namespace fork1s
