// The loops of Sweep::Find.
#pragma once

#include <algorithm>
#include <array>

namespace fork1s::internal {

// act(k) for those of begin to end - 1 that overlap box `at` of `of` on the second and third axis.
template <class Act>
void Sweep::ForOverlaps(const Sides& sides, std::size_t begin, std::size_t end, const Sides& of,
                        std::size_t at, const Act& act) {
  const float low1 = of.low[1][at], high1 = of.high[1][at], low2 = of.low[2][at], high2 = of.high[2][at];
  for (std::size_t from = begin; from < end; from += kLanes) {
    const float *l1 = &sides.low[1][from], *h1 = &sides.high[1][from], *l2 = &sides.low[2][from],
                *h2 = &sides.high[2][from];
    std::array<int, kLanes> hits;
    int any = 0;
    for (std::size_t k = 0; k < kLanes; ++k) {
      hits[k] = int(l1[k] <= high1) & int(h1[k] >= low1) & int(l2[k] <= high2) & int(h2[k] >= low2);
      any |= hits[k];
    }
    if (any == 0) continue;
    const std::size_t count = std::min(kLanes, end - from);
    for (std::size_t k = 0; k < count; ++k)
      if (hits[k] != 0) act(from + k);
  }
}

template <class Visit, class VisitStill>
void Sweep::Find(std::size_t begin, std::size_t end, const Visit& visit,
                 const VisitStill& visit_still) const {
  const auto count = static_cast<std::ptrdiff_t>(order_.size());
  for (std::size_t i = begin; i < end; ++i) {
    const int item = order_[i].item;
    const auto first = sides_.low[0].begin();
    const auto behind = static_cast<std::size_t>(
        std::upper_bound(first + static_cast<std::ptrdiff_t>(i) + 1, first + count, sides_.high[0][i]) -
        first);
    ForOverlaps(sides_, i + 1, behind, sides_, i, [&](std::size_t k) { visit(item, order_[k].item); });
    if (still_order_.empty()) continue;
    // Still boxes that begin before this one ends, back to where none reaches it any more.
    const auto still = still_sides_.low[0].begin();
    const auto last = static_cast<std::size_t>(
        std::upper_bound(still, still + static_cast<std::ptrdiff_t>(still_order_.size()), own_.high[0][i]) -
        still);
    const auto from = static_cast<std::size_t>(
        std::lower_bound(still_reach_.begin(), still_reach_.begin() + static_cast<std::ptrdiff_t>(last),
                         own_.low[0][i]) -
        still_reach_.begin());
    ForOverlaps(still_sides_, from, last, own_, i, [&](std::size_t k) {
      if (still_sides_.high[0][k] >= own_.low[0][i]) visit_still(item, still_order_[k].item);
    });
  }
}

}  // namespace fork1s::internal
