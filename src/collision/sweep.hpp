// Which of many boxes may touch: sweep and prune along the axis on which they are spread the most.
//
// Boxes are sorted by where they begin on that axis, so that those which overlap one on it stand behind it in
// one run. The order hardly changes from one time to the next, which makes sorting cheap; the run of each box
// is looked through by itself, so that boxes may be shared out among threads. What is found depends on
// neither.
#pragma once

#include <fork1s/base/types.hpp>
#include <vector>

namespace fork1s::internal {

/// Sides parallel to the world's axes.
struct AxisBox {
  Vector3 low = Vector3::Zero(), high = Vector3::Zero();
};

class Sweep {
 public:
  /// Boxes that never move, once.
  void SetStill(std::vector<AxisBox> boxes);
  /// Before Find: where those that move are now.
  void Sort(const std::vector<AxisBox>& moving, double margin);

  /// visit(i, j) for every two moving boxes nearer to each other than the margin along every axis, once, and
  /// visit_still(i, k) for a moving and a still one: of those whose place in the sorted order is begin to end
  /// - 1 with all behind them. May report some that are a little farther apart.
  template <class Visit, class VisitStill>
  void Find(std::size_t begin, std::size_t end, const Visit& visit, const VisitStill& visit_still) const;

 private:
  static constexpr std::size_t kLanes = 16;  // boxes compared at a time
  // Boxes in order, single precision and rounded outwards, one array a side: compilers compare many at a
  // time.
  struct Sides {
    std::vector<float> low[3], high[3];  // along the axis of the order, then the other two; padded
    void Resize(std::size_t count);
    void Set(std::size_t at, const AxisBox& box, int axis, double margin);
  };
  struct Place {
    double low;
    int item;
    bool operator<(const Place& o) const { return low < o.low || (low == o.low && item < o.item); }
  };
  template <class Act>
  static void ForOverlaps(const Sides& sides, std::size_t begin, std::size_t end, const Sides& of,
                          std::size_t at, const Act& act);

  std::vector<Place> order_, still_order_;
  Sides sides_, own_;  // own_: along the still boxes' axis
  Sides still_sides_;
  std::vector<float> still_reach_;  // the farthest that any still box up to this one reaches
  int still_axis_ = 0;
};

}  // namespace fork1s::internal

#include "sweep_find.hpp"
