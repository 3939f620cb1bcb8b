// Which contact of the last step a contact is.
#include <algorithm>
#include <numeric>
#include <tuple>

#include "detail.hpp"

namespace fork1s {
namespace {

// What touches what.
auto Shapes(const ContactPoint& p) { return std::tuple(p.body_a, p.body_b, p.geometry_a, p.geometry_b); }

}  // namespace

// A contact is the one of the last step that lies at the same place of either body: a corner of one keeps its
// place there however far it slides on the other, the place beside its axle where it rolls, and where neither
// keeps its place it is the nearest one. Of all such pairs the nearest first, whatever order the detector
// found them in.
void World::Detail::MatchPrevious() {
  match_.assign(points_.size(), -1);
  const auto of = [&](int k) -> const ContactPoint& { return previous_[static_cast<std::size_t>(k)].point; };
  const auto before = [&](int k, int l) { return std::pair(Shapes(of(k)), k) < std::pair(Shapes(of(l)), l); };
  previous_order_.resize(previous_.size());
  std::iota(previous_order_.begin(), previous_order_.end(), 0);
  if (!std::is_sorted(previous_order_.begin(), previous_order_.end(), before))
    std::sort(previous_order_.begin(), previous_order_.end(), before);
  previous_used_.assign(previous_.size(), 0);
  // Points between the same two shapes follow each other; what they are is their own affair.
  patches_.clear();
  for (std::size_t i = 0; i < points_.size(); ++i)
    if (i == 0 || Shapes(points_[i]) != Shapes(points_[i - 1])) patches_.push_back(i);
  patches_.push_back(points_.size());
  const std::size_t patches = patches_.size() - 1;
  constexpr std::size_t kWorthABench = 64;  // patches, some 5 us
  const std::size_t benches = std::clamp<std::size_t>(patches / kWorthABench, 1, kMostBenches);
  while (match_benches_.size() < benches) match_benches_.emplace_back();
  ForAll(benches, 1, [&](std::size_t bench) {
    for (std::size_t k = bench * patches / benches; k < (bench + 1) * patches / benches; ++k)
      MatchPatch(patches_[k], patches_[k + 1], match_benches_[bench]);
  });
}

void World::Detail::MatchPatch(std::size_t begin, std::size_t end, MatchBench& bench) {
  const auto of = [&](int k) -> const ContactPoint& { return previous_[static_cast<std::size_t>(k)].point; };
  const auto shapes = Shapes(points_[begin]);
  const auto first = std::lower_bound(previous_order_.begin(), previous_order_.end(), shapes,
                                      [&](int k, const auto& wanted) { return Shapes(of(k)) < wanted; });
  auto last = first;
  bool any_bore = false;
  for (; last != previous_order_.end() && Shapes(of(*last)) == shapes; ++last)
    any_bore = any_bore || !previous_[static_cast<std::size_t>(*last)].impulse.isZero(0);
  if (!any_bore) return;  // what was merely near has nothing to hand on
  const int* order = previous_order_.data();
  AddCandidates(begin, end, order + (first - previous_order_.begin()),
                order + (last - previous_order_.begin()), bench);
  std::sort(bench.candidates.begin(), bench.candidates.end());
  for (const auto& [moved, i, k] : bench.candidates) {
    if (match_[static_cast<std::size_t>(i)] >= 0 || previous_used_[static_cast<std::size_t>(k)]) continue;
    match_[static_cast<std::size_t>(i)] = k;
    previous_used_[static_cast<std::size_t>(k)] = 1;
  }
}

void World::Detail::AddCandidates(std::size_t begin, std::size_t end, const int* first, const int* last,
                                  MatchBench& bench) const {
  // Shares of the pair's size: what moved farther over both bodies is another contact; points nearer than
  // that carry what one of them carries.
  constexpr double kFarthestShare = 0.5, kStayShare = 2e-3;
  const double size = PairSize(points_[begin]);
  const double most = size * size * kFarthestShare * kFarthestShare,  // m²
      stays = size * size * kStayShare * kStayShare;
  bench.candidates.clear();
  const auto add = [&](const auto& distance) {
    double farthest = 0;  // of the points that are nearest to each
    for (std::size_t i = begin; i < end; ++i) {
      double nearest = most;
      for (const int* k = first; k != last; ++k) {
        const ContactPoint& o = previous_[static_cast<std::size_t>(*k)].point;
        if (o.frame.row(0).dot(points_[i].frame.row(0)) <= 0.8) continue;
        const double moved = distance(i, k, o);
        nearest = std::min(nearest, moved);
        if (moved < most) bench.candidates.push_back({moved, static_cast<int>(i), *k});
      }
      farthest = std::max(farthest, nearest);
    }
    return farthest;
  };
  const double farthest = add([&](std::size_t i, const int*, const ContactPoint& o) {
    return (o.point - points_[i].point).squaredNorm();
  });
  const bool one_each = end == begin + 1 && last == first + 1;
  if (first == last || farthest < (one_each ? most : stays)) return;

  bench.places.clear();
  const auto keep = [&](const ContactPoint& p, const std::vector<RigidTransform>& poses) {
    const auto on = [&](int contactor) -> Vector3 {
      const RigidTransform& X = poses[static_cast<std::size_t>(contactor)];
      return X.rotation().transpose() * (p.point - X.translation());
    };
    const auto beside = [&](int contactor) -> Vector3 {
      return p.point - poses[static_cast<std::size_t>(contactor)].translation();
    };
    bench.places.push_back({on(p.body_a), on(p.body_b), beside(p.body_a), beside(p.body_b)});
  };
  for (const int* k = first; k != last; ++k)
    keep(previous_[static_cast<std::size_t>(*k)].point, previous_pose_);
  for (std::size_t i = begin; i < end; ++i) keep(points_[i], contactor_pose_);
  bench.candidates.clear();
  add([&](std::size_t i, const int* k, const ContactPoint& o) {
    const auto &then = bench.places[static_cast<std::size_t>(k - first)],
               &now = bench.places[static_cast<std::size_t>(last - first) + i - begin];
    double nearest = (o.point - points_[i].point).squaredNorm();
    for (std::size_t w = 0; w < now.size(); ++w)
      nearest = std::min(nearest, (now[w] - then[w]).squaredNorm());
    return nearest;
  });
}

}  // namespace fork1s
