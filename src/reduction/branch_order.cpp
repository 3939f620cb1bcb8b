#include "branch_order.hpp"

#include <algorithm>
#include <numeric>

namespace fork1s::internal {

std::vector<int> BranchOrder(const Mechanism& mechanism, const ElasticBasis& basis) {
  // A joint's place: after all that its earlier siblings carry. Joints stand before those that they carry.
  const auto n = static_cast<std::size_t>(mechanism.num_joints());
  std::vector<int> carried(n, 1), next(n, 1), place(n, 0);
  for (std::size_t j = n; j-- > 0;)
    if (const int p = mechanism.joints()[j].previous; p >= 0)
      carried[static_cast<std::size_t>(p)] += carried[j];
  int next_root = 0;
  for (std::size_t j = 0; j < n; ++j) {
    const int p = mechanism.joints()[j].previous;
    const auto at = static_cast<std::size_t>(std::max(p, 0));
    place[j] = p < 0 ? next_root : place[at] + next[at];
    (p < 0 ? next_root : next[at]) += carried[j];
  }
  std::vector<int> order(basis.sprung.size());
  std::iota(order.begin(), order.end(), 0);
  const auto place_of = [&](int column) {
    return place[mechanism.CoordinateJoint(basis.sprung[static_cast<std::size_t>(column)]).u()];
  };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return place_of(a) < place_of(b); });
  return order;
}

MatrixX BranchIdentity(const Mechanism& mechanism, const ElasticBasis& basis) {
  const std::vector<int> order = BranchOrder(mechanism, basis);
  const auto e = static_cast<Eigen::Index>(order.size());
  MatrixX Y = MatrixX::Zero(e, e);
  for (Eigen::Index c = 0; c < e; ++c) Y(order[static_cast<std::size_t>(c)], c) = 1;
  return Y;
}

}  // namespace fork1s::internal
