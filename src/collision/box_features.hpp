// Corners and edges of a box with the given half sizes, in its frame.
#pragma once

#include <fork1s/base/types.hpp>

namespace fork1s::internal {

/// The k-th of the eight.
inline Vector3 Corner(const Vector3& half, int k) {
  return half.cwiseProduct(Vector3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1));
}

/// The farthest along n.
inline Vector3 DeepestCorner(const Vector3& half, const Vector3& n) {
  return {n.x() < 0 ? -half.x() : half.x(), n.y() < 0 ? -half.y() : half.y(),
          n.z() < 0 ? -half.z() : half.z()};
}

/// Of the k-th of the four edges along an axis.
inline Vector3 EdgeMiddle(const Vector3& half, int axis, int k) {
  Vector3 middle = Vector3::Zero();
  const int next = (axis + 1) % 3, last = (axis + 2) % 3;
  middle[next] = k & 1 ? half[next] : -half[next];
  middle[last] = k & 2 ? half[last] : -half[last];
  return middle;
}

}  // namespace fork1s::internal
