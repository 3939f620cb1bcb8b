// The way of a taut thread round a circle, a sphere or a cylinder.
#pragma once

#include <fork1s/base/types.hpp>

namespace fork1s::internal {

/// Where a thread touches an obstacle: from `first` to `last` it lies on it, `along` metres of it.
struct Wrap {
  bool touches = false;
  Vector3 first, last;  // m, in the obstacle's axes about its centre
  double along = 0;     // m
};

/// A thread from point a to point b round an obstacle of this radius, all in the obstacle's axes about its
/// centre; a cylinder's axis is z, and it has no ends. Without `side` it touches where the straight line
/// would go through, on the shorter way round. With it a line that passes the centre on the other side,
/// across the half line from the centre away from that point, goes round on the side of the point, even where
/// it would be free; another line as if there were no side. A side point nearer to the centre than the radius
/// asks for the way through the hole of a ring, which the thread touches at one point.
///
/// The length of the whole thread is stationary under shifts of the two points, so its derivative is that of
/// its straight parts with `first` and `last` fixed to the obstacle. Which way round, and when to let go, are
/// MuJoCo's decisions.
Wrap WrapSphere(const Vector3& a, const Vector3& b, double radius, const Vector3* side);
Wrap WrapCylinder(const Vector3& a, const Vector3& b, double radius, const Vector3* side);

}  // namespace fork1s::internal
