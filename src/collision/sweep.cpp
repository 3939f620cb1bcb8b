#include "sweep.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fork1s::internal {
namespace {

// Half a unit in the last place is 6e-8 of the value.
constexpr double kOutward = 1.5e-7;
float Below(double x) { return static_cast<float>(x - kOutward * std::abs(x)); }
float Above(double x) { return static_cast<float>(x + kOutward * std::abs(x)); }

// On which the middles are spread the most.
int WidestAxis(const std::vector<AxisBox>& boxes) {
  Vector3 sum = Vector3::Zero(), squares = Vector3::Zero();
  for (const AxisBox& box : boxes) {
    const Vector3 middle = box.low + box.high;
    sum += middle;
    squares += middle.cwiseProduct(middle);
  }
  const Vector3 spread =
      squares - sum.cwiseProduct(sum) / static_cast<double>(std::max<std::size_t>(1, boxes.size()));
  Eigen::Index axis = 0;
  spread.maxCoeff(&axis);
  return static_cast<int>(axis);
}

}  // namespace

void Sweep::Sides::Resize(std::size_t count) {
  // What stands behind the last one overlaps nothing.
  for (auto& side : low) side.assign(count + kLanes, std::numeric_limits<float>::infinity());
  for (auto& side : high) side.assign(count + kLanes, -std::numeric_limits<float>::infinity());
}

void Sweep::Sides::Set(std::size_t at, const AxisBox& box, int axis, double margin) {
  for (int k = 0; k < 3; ++k) {
    const int from = (axis + k) % 3;
    low[k][at] = Below(box.low[from] - margin);
    high[k][at] = Above(box.high[from] + margin);
  }
}

void Sweep::SetStill(std::vector<AxisBox> boxes) {
  still_axis_ = WidestAxis(boxes);
  still_order_.clear();
  for (std::size_t k = 0; k < boxes.size(); ++k)
    still_order_.push_back({boxes[k].low[still_axis_], static_cast<int>(k)});
  std::sort(still_order_.begin(), still_order_.end());
  still_sides_.Resize(boxes.size());
  still_reach_.clear();
  float reach = -std::numeric_limits<float>::infinity();
  for (std::size_t k = 0; k < still_order_.size(); ++k) {
    still_sides_.Set(k, boxes[static_cast<std::size_t>(still_order_[k].item)], still_axis_, 0);
    reach = std::max(reach, still_sides_.high[0][k]);
    still_reach_.push_back(reach);
  }
}

void Sweep::Sort(const std::vector<AxisBox>& moving, double margin) {
  if (order_.size() != moving.size()) {
    order_.clear();
    for (std::size_t i = 0; i < moving.size(); ++i) order_.push_back({0, static_cast<int>(i)});
    sides_.Resize(moving.size());
    own_.Resize(moving.size());
  }
  const int axis = WidestAxis(moving);
  // A pose that is no number comes last: such a box overlaps none, and has no place among numbers.
  for (Place& place : order_) {
    const double low = moving[static_cast<std::size_t>(place.item)].low[axis];
    place.low = std::isnan(low) ? std::numeric_limits<double>::infinity() : low;
  }
  // In place where they are nearly sorted, as they mostly are; a few moves an item are cheaper than sorting.
  std::size_t moves = 0;
  for (std::size_t i = 1; i < order_.size() && moves <= 8 * order_.size(); ++i) {
    const Place place = order_[i];
    std::size_t k = i;
    for (; k > 0 && place < order_[k - 1]; --k, ++moves) order_[k] = order_[k - 1];
    order_[k] = place;
  }
  if (moves > 8 * order_.size()) std::sort(order_.begin(), order_.end());
  // A box that stands at half the margin farther meets another that does so.
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const AxisBox& box = moving[static_cast<std::size_t>(order_[i].item)];
    sides_.Set(i, box, axis, 0.5 * margin);
    if (!still_order_.empty()) own_.Set(i, box, still_axis_, margin);
  }
}

}  // namespace fork1s::internal
