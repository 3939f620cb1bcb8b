#include "whole_groups.hpp"

#include <algorithm>
#include <numeric>

namespace fork1s::internal {
namespace {

// Sets that are joined one by one.
class Sets {
 public:
  explicit Sets(int size) : above_(static_cast<std::size_t>(size)) {
    std::iota(above_.begin(), above_.end(), 0);
  }
  int Of(int i) {
    while (above_[static_cast<std::size_t>(i)] != i) i = above_[static_cast<std::size_t>(i)];
    return i;
  }
  void Join(int i, int j) { above_[static_cast<std::size_t>(Of(j))] = Of(i); }

 private:
  std::vector<int> above_;
};

}  // namespace

std::vector<char> FindWhole(const ReducedModel& model) {
  const Mechanism& m = *model.mechanism;
  const int n = model.num_coordinates(), r = model.size();
  Sets sets(n);
  for (const Mechanism::Joint& joint : m.joints()) {
    for (int i = joint.offset + 1; i < joint.offset + joint.size; ++i) sets.Join(joint.offset, i);
    if (joint.previous >= 0 && joint.size > 0)
      sets.Join(joint.offset, m.joints()[static_cast<std::size_t>(joint.previous)].offset);
  }
  std::vector<int> first(static_cast<std::size_t>(r), -1);  // coordinate that a column moves
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < r; ++k) {
      if (model.Q(i, k) == 0) continue;
      int& of_column = first[static_cast<std::size_t>(k)];
      if (of_column < 0) of_column = i;
      sets.Join(of_column, i);
    }
  std::vector<int> missing(static_cast<std::size_t>(n), 0);  // of a set: coordinates without a column
  for (int i = 0; i < n; ++i) ++missing[static_cast<std::size_t>(sets.Of(i))];
  for (const int i : first)
    if (i >= 0) --missing[static_cast<std::size_t>(sets.Of(i))];

  const auto bends = [&](int i) { missing[static_cast<std::size_t>(sets.Of(i))] = n + r; };
  const auto all_bend = [&](const std::vector<int>& coordinates) {
    for (const int i : coordinates) bends(i);
  };
  for (const ClosureDef& c : m.closures()) all_bend(ClosureCoordinates(m, c));
  for (const Mechanism::Coupling& c : m.couplings()) {
    bends(c.a);
    if (c.b >= 0) bends(c.b);
  }
  for (const Mechanism::Path& p : m.paths()) all_bend(p.coordinates);
  for (const Mechanism::Spring& s : m.springs())
    if (!s.is_linear()) all_bend(m.CoordinatesOf(s.length));
  for (const Mechanism::Joint& joint : m.joints())
    if (joint.size > 1) bends(joint.offset);

  std::vector<char> whole(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i)
    whole[static_cast<std::size_t>(i)] = missing[static_cast<std::size_t>(sets.Of(i))] == 0;
  return whole;
}

}  // namespace fork1s::internal
