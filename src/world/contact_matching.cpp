#include "contact_matching.hpp"

#include <algorithm>
#include <numeric>

#include "for_all.hpp"

namespace fork1s {
ContactMatcher::Scratch::Scratch() {
  candidates.reserve(16);  // a patch of four beside one of four
  places.reserve(16);
}

void ContactMatcher::Reserve(std::size_t contacts) {
  used_.reserve(contacts);
  order_.reserve(contacts);
  patches_.reserve(contacts);
  scratches_.reserve(kMostBenches);
}

void ContactMatcher::SortPrevious(const Input& in) {
  const auto before = [&](int k, int l) {
    return std::pair(Shapes(in.Previous(k)), k) < std::pair(Shapes(in.Previous(l)), l);
  };
  order_.resize(in.previous.size());
  std::iota(order_.begin(), order_.end(), 0);
  if (!std::is_sorted(order_.begin(), order_.end(), before)) std::sort(order_.begin(), order_.end(), before);
  used_.assign(in.previous.size(), 0);
}

void ContactMatcher::FindPatches(const std::vector<ContactPoint>& points) {
  patches_.clear();
  for (std::size_t i = 0; i < points.size(); ++i)
    if (i == 0 || Shapes(points[i]) != Shapes(points[i - 1]))
      patches_.push_back({i, i + 1});
    else
      patches_.back().end = i + 1;
}

void ContactMatcher::Match(const CollisionBodyShapes& shapes, const std::vector<ContactPoint>& points,
                           const std::vector<RigidTransform>& poses,
                           const std::vector<ContactRecord>& previous,
                           const std::vector<RigidTransform>& previous_poses, std::vector<int>& match) {
  const Input in{shapes, points, poses, previous, previous_poses};
  match.assign(points.size(), -1);
  SortPrevious(in);
  FindPatches(points);
  constexpr std::size_t kWorthABench = 64;  // patches, some 5 us
  const std::size_t patches = patches_.size(),
                    benches = std::clamp<std::size_t>(patches / kWorthABench, 1, kMostBenches);
  while (scratches_.size() < benches) scratches_.emplace_back();
  ForAll(benches, 1, [&](std::size_t scratch) {
    for (std::size_t k = scratch * patches / benches; k < (scratch + 1) * patches / benches; ++k)
      MatchPatch(in, patches_[k], scratches_[scratch], match);
  });
}

void ContactMatcher::MatchPatch(const Input& in, const Patch& patch, Scratch& scratch,
                                std::vector<int>& match) {
  const auto shapes = Shapes(in.points[patch.begin]);
  const auto first = std::lower_bound(order_.begin(), order_.end(), shapes, [&](int k, const auto& wanted) {
    return Shapes(in.Previous(k)) < wanted;
  });
  auto last = first;
  bool any_bore = false;
  for (; last != order_.end() && Shapes(in.Previous(*last)) == shapes; ++last)
    any_bore = any_bore || !in.previous[static_cast<std::size_t>(*last)].impulse.isZero(0);
  if (!any_bore) return;  // what was merely near has nothing to hand on
  const int* order = order_.data();
  AddCandidates(in, patch, {order + (first - order_.begin()), order + (last - order_.begin())}, scratch);
  std::sort(scratch.candidates.begin(), scratch.candidates.end());
  for (const auto& [moved, i, k] : scratch.candidates) {
    if (match[static_cast<std::size_t>(i)] >= 0 || used_[static_cast<std::size_t>(k)]) continue;
    match[static_cast<std::size_t>(i)] = k;
    used_[static_cast<std::size_t>(k)] = 1;
  }
}

void ContactMatcher::AddCandidates(const Input& in, const Patch& patch, const Range& previous,
                                   Scratch& scratch) {
  // Shares of the pair's size: what moved farther over both bodies is another contact; points nearer than
  // that carry what one of them carries.
  constexpr double kFarthestShare = 0.5, kStayShare = 2e-3;
  const double size = in.shapes.PairSize(in.points[patch.begin]);
  const double most = size * size * kFarthestShare * kFarthestShare,  // m²
      stays = size * size * kStayShare * kStayShare;
  scratch.candidates.clear();
  const auto add = [&](const auto& distance) {
    double farthest = 0;  // of the points that are nearest to each
    for (std::size_t i = patch.begin; i < patch.end; ++i) {
      double nearest = most;
      for (const int* k = previous.first; k != previous.last; ++k) {
        const ContactPoint& o = in.Previous(*k);
        if (o.frame.row(0).dot(in.points[i].frame.row(0)) <= 0.8) continue;
        const double moved = distance(i, k, o);
        nearest = std::min(nearest, moved);
        if (moved < most) scratch.candidates.push_back({moved, static_cast<int>(i), *k});
      }
      farthest = std::max(farthest, nearest);
    }
    return farthest;
  };
  const double farthest = add([&](std::size_t i, const int*, const ContactPoint& o) {
    return (o.point - in.points[i].point).squaredNorm();
  });
  const bool one_each = patch.end == patch.begin + 1 && previous.last == previous.first + 1;
  if (previous.first == previous.last || farthest < (one_each ? most : stays)) return;

  scratch.places.clear();
  const auto keep = [&](const ContactPoint& p, const std::vector<RigidTransform>& poses) {
    const auto on = [&](int collision_body) -> Vector3 {
      const RigidTransform& X = poses[static_cast<std::size_t>(collision_body)];
      return X.rotation().transpose() * (p.point - X.translation());
    };
    const auto beside = [&](int collision_body) -> Vector3 {
      return p.point - poses[static_cast<std::size_t>(collision_body)].translation();
    };
    scratch.places.push_back({on(p.body_a), on(p.body_b), beside(p.body_a), beside(p.body_b)});
  };
  for (const int* k = previous.first; k != previous.last; ++k) keep(in.Previous(*k), in.previous_poses);
  for (std::size_t i = patch.begin; i < patch.end; ++i) keep(in.points[i], in.poses);
  scratch.candidates.clear();
  add([&](std::size_t i, const int* k, const ContactPoint& o) {
    const auto &then = scratch.places[static_cast<std::size_t>(k - previous.first)],
               &now =
                   scratch.places[static_cast<std::size_t>(previous.last - previous.first) + i - patch.begin];
    double nearest = (o.point - in.points[i].point).squaredNorm();
    for (std::size_t w = 0; w < now.size(); ++w)
      nearest = std::min(nearest, (now[w] - then[w]).squaredNorm());
    return nearest;
  });
}

}  // namespace fork1s
