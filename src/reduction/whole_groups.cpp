#include "reduction/whole_groups.hpp"

#include <algorithm>

#include "coordinate_groups.hpp"

namespace fork1s {

std::vector<char> FindWhole(const ReducedModel& model) {
  const Mechanism& m = *model.mechanism;
  std::vector<char> bends = internal::FindPoseDependent(m);
  for (const Mechanism::Joint& joint : m.joints())
    if (joint.size > 1) bends[static_cast<std::size_t>(joint.offset)] = 1;

  std::vector<char> whole(bends.size(), 0);
  for (const std::vector<int>& group : internal::CoordinateGroups(m)) {
    const bool any_bends = std::any_of(group.begin(), group.end(),
                                       [&](int i) { return bends[static_cast<std::size_t>(i)] != 0; });
    if (any_bends) continue;
    int columns = 0;
    for (int k = 0; k < model.size(); ++k)
      columns += std::any_of(group.begin(), group.end(), [&](int i) { return model.Q(i, k) != 0; }) ? 1 : 0;
    if (columns < static_cast<int>(group.size())) continue;
    for (const int i : group) whole[static_cast<std::size_t>(i)] = 1;
  }
  return whole;
}

}  // namespace fork1s
